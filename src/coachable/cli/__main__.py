"""`python -m coachable.cli` is `coachable`."""

from coachable.cli import main

main()
