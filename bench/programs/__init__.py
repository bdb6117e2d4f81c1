"""The programs that are timed by bench/child.py. Each module has `prepare(**sizes) -> (work, units)`."""
