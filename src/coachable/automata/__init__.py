"""The formal model of a behaviour: a hybrid automaton, its execution, and monitors of recorded runs."""
