"""Drawing a robot pixel by pixel: what a film shows, and an environment that is watched while it runs."""
