"""How fast coachable is, beside what one would use instead. `make bench` prints the table."""
