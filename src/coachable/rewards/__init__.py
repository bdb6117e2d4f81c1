"""What a movement is worth: section III of the paper, derived from a behaviour."""

from typing import TYPE_CHECKING

from coachable.foundation.lazy import lazily

if TYPE_CHECKING:
    from coachable.rewards.described_reward import DescribedReward as DescribedReward
    from coachable.rewards.described_reward import RewardMemory as RewardMemory
    from coachable.rewards.described_reward import StepInfo as StepInfo
    from coachable.rewards.difference import Difference as Difference
    from coachable.rewards.difference import differences as differences
    from coachable.rewards.forms import Equation as Equation
    from coachable.rewards.forms import Potential as Potential
    from coachable.rewards.forms import Released as Released
    from coachable.rewards.forms import RewardForm as RewardForm
    from coachable.rewards.forms import Schedule as Schedule
    from coachable.rewards.forms import Shaping as Shaping
    from coachable.rewards.forms import Stay as Stay
    from coachable.rewards.run_reward import RunReward as RunReward
    from coachable.rewards.setup import PAPER_SETUPS as PAPER_SETUPS
    from coachable.rewards.setup import DescribedSetup as DescribedSetup
    from coachable.rewards.setup import RewardSetup as RewardSetup

_HOMES = {
    "DescribedReward": "rewards.described_reward",
    "DescribedSetup": "rewards.setup",
    "Difference": "rewards.difference",
    "Equation": "rewards.forms",
    "PAPER_SETUPS": "rewards.setup",
    "Potential": "rewards.forms",
    "Released": "rewards.forms",
    "RewardForm": "rewards.forms",
    "RewardMemory": "rewards.described_reward",
    "RewardSetup": "rewards.setup",
    "RunReward": "rewards.run_reward",
    "Schedule": "rewards.forms",
    "Shaping": "rewards.forms",
    "Stay": "rewards.forms",
    "StepInfo": "rewards.described_reward",
    "differences": "rewards.difference",
}

__all__ = sorted(_HOMES)  # pyright: ignore[reportUnsupportedDunderAll]
__getattr__, __dir__ = lazily(__name__, _HOMES)
