"""Reward forms: how a behaviour pays."""

from coachable.rewards.forms.data import FORMS, form_from_data, form_of
from coachable.rewards.forms.form import BoundForm, Payment, RewardForm, Step
from coachable.rewards.forms.potential import Potential, Shaping
from coachable.rewards.forms.schedule import Schedule
from coachable.rewards.forms.tables import VARIANTS, Equation, Released, Stay, Variant, reward_table

__all__ = [
    "FORMS",
    "VARIANTS",
    "BoundForm",
    "Equation",
    "Payment",
    "Potential",
    "Released",
    "RewardForm",
    "Schedule",
    "Shaping",
    "Stay",
    "Step",
    "Variant",
    "form_from_data",
    "form_of",
    "reward_table",
]
