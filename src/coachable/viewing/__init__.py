"""Looking at a walk: a strobe picture, a gif, a film."""
