"""The checker: what a description says that was not meant, decided by a solver, with a state for each."""
