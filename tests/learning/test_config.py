"""PPO's settings are checked once, at construction, and the message names the setting."""

import pytest

from coachable.foundation.errors import PlanError
from coachable.learning.config import EnvironmentPPOConfig, PPOConfig


@pytest.mark.parametrize(
    ("name", "value"),
    [
        ("learning_rate", 0.0),
        ("learning_rate", float("nan")),
        ("n_steps", 0),
        ("batch_size", 1),
        ("batch_size", 60),
        ("n_epochs", -1),
        ("gamma", 1.5),
        ("gae_lambda", -0.1),
        ("clip_range", 0.0),
        ("ent_coef", -1.0),
        ("max_grad_norm", 0.0),
        ("hidden_sizes", (64, 0)),
        ("n_epochs", True),
    ],
)
def test_a_senseless_value_is_refused_by_name(name, value):
    with pytest.raises(PlanError, match=rf"ppo\.{name}"):
        PPOConfig(**{name: value})


@pytest.mark.parametrize("value", [-0.1, 1.1, True, float("nan")])
def test_a_share_is_between_0_and_1(value):
    with pytest.raises(PlanError, match=r"ppo\.anneal"):
        EnvironmentPPOConfig(anneal=value)
