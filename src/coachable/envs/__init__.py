"""Tasks to be learned: an environment with a reward, its rollouts, and its baselines."""
