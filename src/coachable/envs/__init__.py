"""Tasks to be learned: an environment with a reward, its rollouts, and its baselines.

Importing this makes `gymnasium.make("coachable/CompassWalker-v0")` work; Gymnasium imports it by itself for
`gymnasium.make("coachable.envs:coachable/CompassWalker-v0")`.
"""

from gymnasium.envs.registration import register

from coachable.envs.baselines import BaselineReport, baseline
from coachable.envs.behaviour_reward import BehaviourReward
from coachable.envs.gymnasium_env import PlantEnv
from coachable.envs.gymnasium_vector_env import PlantVectorEnv
from coachable.envs.problem import EnvironmentProblem, PlantProblem, Problem
from coachable.envs.rollout import Trajectory
from coachable.envs.signals import SignalPack, signal_pack
from coachable.envs.task import Task, Timestep
from coachable.envs.vector_behaviour_reward import VectorBehaviourReward
from coachable.envs.walking_task import WalkingTask, make_task

__all__ = [
    "BaselineReport",
    "BehaviourReward",
    "EnvironmentProblem",
    "PlantEnv",
    "PlantProblem",
    "PlantVectorEnv",
    "Problem",
    "SignalPack",
    "Task",
    "Timestep",
    "Trajectory",
    "VectorBehaviourReward",
    "WalkingTask",
    "baseline",
    "make_task",
    "signal_pack",
]

register(
    id="coachable/CompassWalker-v0",
    entry_point="coachable.envs.gymnasium_env:PlantEnv",
    vector_entry_point="coachable.envs.gymnasium_vector_env:PlantVectorEnv",
)
