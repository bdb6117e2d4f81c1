"""From how many starts, and under which disturbances, a walker keeps walking."""
