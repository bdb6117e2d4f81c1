"""Tasks to be learned: an environment with a reward, its rollouts, and its baselines.

Importing this makes `gymnasium.make("coachable/CompassWalker-v0")` work; Gymnasium imports it by itself for
`gymnasium.make("coachable.envs:coachable/CompassWalker-v0")`.
"""

from gymnasium.envs.registration import register

register(
    id="coachable/CompassWalker-v0",
    entry_point="coachable.envs.gymnasium_env:PlantEnv",
    vector_entry_point="coachable.envs.gymnasium_vector_env:PlantVectorEnv",
)
