"""How lanes are trained: by our PPO on tasks in JAX, or by a learner on Gymnasium environments."""
