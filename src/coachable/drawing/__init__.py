"""Drawing the walker pixel by pixel: what a film shows, and an environment that is watched while it runs."""
