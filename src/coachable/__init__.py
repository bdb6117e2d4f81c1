"""Say how a robot should move; get the reward, the trained policy, and evidence that it moves that way.

    import coachable as co

    walk = co.load_behaviour("compass-walking")
    run = co.train("paper", out="runs/paper", seeds=15)
    policy = co.open_run("runs/paper").policy("orthant", seed=3)
    trajectory = co.rollout(policy, seconds=10.0)

Names are loaded when they are first used, so that importing this package is quick.
"""

from importlib import import_module
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from coachable.analysis.citation import citation as citation
    from coachable.automata.hybrid import HybridAutomaton as HybridAutomaton
    from coachable.automata.monitor import Monitor as Monitor
    from coachable.behaviours.behaviour import Behaviour as Behaviour
    from coachable.behaviours.library import load_behaviour as load_behaviour
    from coachable.envs.baselines import baseline as baseline
    from coachable.envs.behaviour_reward import BehaviourReward as BehaviourReward
    from coachable.envs.rollout import Trajectory as Trajectory
    from coachable.envs.signals import signal_pack as signal_pack
    from coachable.envs.vector_behaviour_reward import VectorBehaviourReward as VectorBehaviourReward
    from coachable.envs.walking_task import make_task as make_task
    from coachable.experiments.api import rollout as rollout
    from coachable.experiments.api import train as train
    from coachable.experiments.experiment import Experiment as Experiment
    from coachable.experiments.plan import load_plan as load_plan
    from coachable.experiments.run_folder.reader import Run as Run
    from coachable.experiments.run_folder.reader import open_run as open_run
    from coachable.foundation.errors import CoachableError as CoachableError
    from coachable.learning.config import PPOConfig as PPOConfig
    from coachable.learning.policy import Policy as Policy
    from coachable.plants.compass import CompassParameters as CompassParameters
    from coachable.plants.compass import CompassWalker as CompassWalker
    from coachable.plants.compass import VirtualGravity as VirtualGravity
    from coachable.plants.controllers import ConstantTorque as ConstantTorque
    from coachable.plants.controllers import NoTorque as NoTorque
    from coachable.rewards.described_reward import DescribedReward as DescribedReward
    from coachable.rewards.forms import Potential as Potential
    from coachable.rewards.forms import RewardForm as RewardForm
    from coachable.rewards.setup import RewardSetup as RewardSetup

_HOMES = {
    "Behaviour": "behaviours.behaviour",
    "BehaviourReward": "envs.behaviour_reward",
    "CoachableError": "foundation.errors",
    "CompassParameters": "plants.compass",
    "CompassWalker": "plants.compass",
    "ConstantTorque": "plants.controllers",
    "DescribedReward": "rewards.described_reward",
    "Experiment": "experiments.experiment",
    "HybridAutomaton": "automata.hybrid",
    "Monitor": "automata.monitor",
    "NoTorque": "plants.controllers",
    "PPOConfig": "learning.config",
    "Policy": "learning.policy",
    "Potential": "rewards.forms",
    "RewardForm": "rewards.forms",
    "RewardSetup": "rewards.setup",
    "Run": "experiments.run_folder.reader",
    "Trajectory": "envs.rollout",
    "VectorBehaviourReward": "envs.vector_behaviour_reward",
    "VirtualGravity": "plants.compass",
    "baseline": "envs.baselines",
    "citation": "analysis.citation",
    "load_behaviour": "behaviours.library",
    "load_plan": "experiments.plan",
    "make_task": "envs.walking_task",
    "open_run": "experiments.run_folder.reader",
    "rollout": "experiments.api",
    "signal_pack": "envs.signals",
    "train": "experiments.api",
}

__all__ = sorted(_HOMES)  # pyright: ignore[reportUnsupportedDunderAll]


def __getattr__(name: str) -> object:
    if name not in _HOMES:
        raise AttributeError(f"module 'coachable' has no attribute {name!r}")
    return getattr(import_module(f"coachable.{_HOMES[name]}"), name)


def __dir__() -> list[str]:
    return sorted({*globals(), *_HOMES})
