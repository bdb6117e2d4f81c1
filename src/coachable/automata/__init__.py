"""The formal model of a behaviour: a hybrid automaton, its execution and its picture."""
