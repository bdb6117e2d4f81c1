"""The automaton with the closed loop, for other tools: KeYmaera X, SpaceEx, plain Python."""
