"""What a movement is worth: section III of the paper, derived from a behaviour."""

from coachable.rewards.described_reward import DescribedReward, RewardMemory, StepInfo
from coachable.rewards.difference import Difference, differences
from coachable.rewards.forms import Equation, Potential, Released, RewardForm, Shaping, Stay
from coachable.rewards.run_reward import RunReward
from coachable.rewards.setup import PAPER_SETUPS, DescribedSetup, RewardSetup

__all__ = [
    "PAPER_SETUPS",
    "DescribedReward",
    "DescribedSetup",
    "Difference",
    "Equation",
    "Potential",
    "Released",
    "RewardForm",
    "RewardMemory",
    "RewardSetup",
    "RunReward",
    "Shaping",
    "Stay",
    "StepInfo",
    "differences",
]
