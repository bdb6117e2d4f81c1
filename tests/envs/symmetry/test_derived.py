"""Mirror images of MuJoCo's robots: what is derived is what the simulator does; what cannot be is named."""

import json

import gymnasium
import numpy as np
import pytest

from coachable import cli
from coachable.behaviours.text.parser import parse
from coachable.envs.symmetry import derived
from coachable.envs.symmetry.derived import derived_symmetry
from coachable.envs.symmetry.mujoco_mirror import mirrors_of
from coachable.foundation.errors import ParameterError

mujoco = pytest.importorskip("mujoco", reason="needs the [mujoco] extra: pip install 'coachable[mujoco]'")

FEET = """
behaviour "feet"
signals
  left_foot_contact
  right_foot_contact
{mirror}
phases
  left_down:  left_foot_contact > 0.5, right_foot_contact < 0.5
  right_down: right_foot_contact > 0.5, left_foot_contact < 0.5
cycle
  left_down -> right_down -> left_down
"""


@pytest.fixture(autouse=True)
def few_states(monkeypatch):
    monkeypatch.setattr(derived, "NUM_STATES", 30)
    monkeypatch.setattr(derived, "NUM_TESTS", 5)


@pytest.fixture(scope="module")
def walker():
    return derived_symmetry(gymnasium.make("Walker2d-v5"))


def test_the_walkers_legs_change_places(walker):
    assert walker.exchanged == (("thigh", "thigh_left"), ("leg", "leg_left"), ("foot", "foot_left"))
    assert walker.mirror.action.sources == (3, 4, 5, 0, 1, 2)
    assert walker.mirror.observation.sources == (0, 1, 5, 6, 7, 2, 3, 4, 8, 9, 10, 14, 15, 16, 11, 12, 13)
    assert {*walker.mirror.action.signs, *walker.mirror.observation.signs} == {1}
    assert walker.errors[1] < 1e-9
    assert walker.errors[10] < 1e-6


@pytest.mark.parametrize("env", ["Walker2d-v5", "Ant-v5", "Humanoid-v5"])
def test_a_mirrored_episode_is_the_mirror_image_of_an_episode(env):
    """Through the environment's own steps, of a model whose sides have been made the same."""
    made, other = gymnasium.make(env), gymnasium.make(env)
    found = derived_symmetry(made)
    mirror, base, theirs = found.mirror, made.unwrapped, other.unwrapped
    assert mirror.observation.is_involution
    assert mirror.action.is_involution
    other.unwrapped.model = base.model
    mujoco_mirror = next(each for each in mirrors_of(base.model) if each.exchanges)
    made.reset(seed=5)
    other.reset(seed=6)
    start = mujoco_mirror.state(base.data.qpos.copy(), base.data.qvel.copy())
    theirs.set_state(*start)
    base.data.qacc_warmstart[:] = theirs.data.qacc_warmstart[:] = 0
    space, rng = made.action_space, np.random.default_rng(0)
    for _ in range(8):
        action = rng.uniform(space.low, space.high)
        seen, reward, *_ = base.step(action)
        image, their_reward, *_ = theirs.step(mirror.action(action))
        np.testing.assert_allclose(image, mirror.observation(seen), atol=1e-5)
        assert their_reward == pytest.approx(reward, abs=1e-5), "what is paid does not depend on the side"


def test_sides_that_differ_are_named_and_the_rest_is_symmetric():
    found = derived_symmetry(gymnasium.make("Humanoid-v5"))
    sentences = [each.sentence for each in found.differences]
    assert "joint right_knee and left_knee differ in stiffness: [0.] and [1.]" in sentences
    assert found.errors[10] < 1e-9
    assert found.errors_as_it_is[10] > 1e-3


def test_a_foot_that_slides_more_is_named():
    env = gymnasium.make("Walker2d-v5")
    env.unwrapped.model.geom("foot_geom").friction[0] = 0.9
    found = derived_symmetry(env)
    assert [(each.kind, each.names, each.field) for each in found.differences] == [
        ("geom", ("foot_geom", "foot_left_geom"), "friction")
    ]


@pytest.mark.parametrize("env", ["Hopper-v5", "HalfCheetah-v5"])
def test_a_robot_without_two_sides_says_so(env):
    with pytest.raises(ParameterError, match=f"{env} has no left and right"):
        derived_symmetry(gymnasium.make(env))


def test_an_environment_that_is_not_mujocos_says_what_to_do():
    with pytest.raises(ParameterError, match="name it in the plan"):
        derived_symmetry(gymnasium.make("Pendulum-v1"))


def test_a_description_has_to_agree():
    agrees = parse(FEET.format(mirror="mirror left <-> right"))
    assert derived_symmetry(gymnasium.make("Walker2d-v5"), agrees).exchanged
    contradicts = parse(FEET.format(mirror="mirror up <-> down"))
    with pytest.raises(
        ParameterError,
        match="in the mirror of behaviour 'feet' left_foot_contact becomes left_foot_contact, but",
    ):
        derived_symmetry(gymnasium.make("Walker2d-v5"), contradicts)


def test_what_is_observed_without_a_partner_is_named():
    class OneFoot(gymnasium.ObservationWrapper):
        """Sees how high one foot is."""

        observation_space = gymnasium.spaces.Box(-np.inf, np.inf, (18,))

        def observation(self, observation):
            return np.append(observation, self.unwrapped.data.body("foot").xpos[2])

    with pytest.raises(ParameterError, match=r"no mirror image in .*\(place 17\)"):
        derived_symmetry(OneFoot(gymnasium.make("Walker2d-v5")))


def test_the_command_prints_the_map_the_test_and_the_differences(capsys):
    cli.main(["symmetry", "Humanoid-v5"])
    shown = capsys.readouterr().out
    assert "right_thigh ↔ left_thigh" in shown
    assert "abdomen_z ↔ -abdomen_z" in shown
    assert "right_knee and left_knee differ in stiffness" in shown
    cli.main(["symmetry", "Walker2d-v5", "--json"])
    data = json.loads(capsys.readouterr().out)
    assert data["action"]["sources"] == [3, 4, 5, 0, 1, 2]
    assert data["differences"] == []
