"""Training: proximal policy optimisation, its networks, and the policies that come out."""

from coachable.learning.config import PPOConfig
from coachable.learning.policy import Policy
from coachable.learning.policy_controller import PolicyController

__all__ = [
    "PPOConfig",
    "Policy",
    "PolicyController",
]
