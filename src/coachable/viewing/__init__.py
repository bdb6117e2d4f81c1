"""Looking at a motion: a strobe picture, a gif, a film."""
