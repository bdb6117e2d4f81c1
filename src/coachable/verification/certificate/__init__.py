"""A box around a gait that is proven to return into itself: proposed here, proven by `checker` alone."""
