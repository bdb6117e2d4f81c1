"""Where no mirror can be derived, a plan names it: which numbers change places, and which their sign."""

import json

import gymnasium
import numpy as np
import pytest

from coachable import cli
from coachable.behaviours.text.parser import parse
from coachable.envs.problem import EnvironmentProblem
from coachable.envs.symmetry.named_mirror import NamedImage, NamedMirror
from coachable.envs.symmetry.phase_mirror import MirroredEnv
from coachable.experiments.experiment import differences
from coachable.experiments.plan import load_plan, parse_plan
from coachable.experiments.run_folder.reader import open_run
from coachable.experiments.runner import run_experiment
from coachable.experiments.trainers import environment_trainer
from coachable.foundation.errors import ParameterError, PlanError, RunFolderError
from coachable.rewards.setup import DescribedSetup
from tests.envs.symmetry.rower import MIRROR, ROBOT, ROWING, TABLES

LEGS = NamedMirror(
    NamedImage(swap=tuple((place, place + 5) for place in range(4, 9))), NamedImage(swap=((0, 2), (1, 3)))
)
PLAN = f"""
env = "{ROBOT}"
behaviour = "rowing.behaviour"
steps = 64
evaluate_every = 64
evaluation_episodes = 1
{TABLES}[setups.rows]
reward_variant = "schedule"
[ppo]
n_envs = 1
n_steps = 64
batch_size = 64
n_epochs = 1
"""


@pytest.fixture
def plan(tmp_path):
    (tmp_path / "rowing.behaviour").write_text(ROWING)
    path = tmp_path / "rower.toml"
    path.write_text(PLAN)
    return path


def problem(mirror, env=ROBOT, behaviour=ROWING, **options):
    signals = {"left_oar": 1, "right_oar": 2}
    return EnvironmentProblem(
        behaviour=parse(behaviour), env=env, signals=signals, mirror_image=mirror, **options
    )


def setup(**options):
    return DescribedSetup(name="a", reward_variant="schedule", **options)


@pytest.mark.parametrize("observe", ["nothing", "memory"])
def test_an_episode_and_its_image_are_one_to_the_policy(observe):
    rower, described = problem(MIRROR), setup(observe=observe)
    mirror, halves = rower.mirror(described), set()
    ours, theirs = (MirroredEnv(rower.environment(described), mirror) for _ in range(2))
    image = MIRROR.of(4, ours).observation
    for seed in range(3):
        seen, _ = ours.reset(seed=seed)
        seen_there, _ = theirs.reset(options={"state": image(ours.unwrapped.state)})
        np.testing.assert_allclose(seen_there, seen, atol=1e-12)
        for action in np.random.default_rng(seed).uniform(-1, 1, (30, 2)):
            (seen, paid, *_), (seen_there, paid_there, *_) = ours.step(action), theirs.step(action)
            np.testing.assert_allclose(seen_there, seen, atol=1e-12)
            assert paid_there == pytest.approx(paid)
            halves.add(ours.get_wrapper_attr("expected_phase"))
    assert halves == {0, 1}


def test_a_walker_of_box2d_changes_its_legs():
    pytest.importorskip("Box2D")
    walking = ROWING.replace("left_oar", "left_knee").replace("right_oar", "right_knee")
    walker = EnvironmentProblem(behaviour=parse(walking), env="BipedalWalker-v3", mirror_image=LEGS)
    mirror = walker.mirror(setup(observe="memory"))
    observation = np.arange(24.0 + 4)
    seen = mirror.observed(observation, 1)
    np.testing.assert_array_equal(seen[:14], [0, 1, 2, 3, 9, 10, 11, 12, 13, 4, 5, 6, 7, 8])
    np.testing.assert_array_equal(seen[14:24], observation[14:24])
    np.testing.assert_array_equal(mirror.done(np.arange(4.0), 1), [2, 3, 0, 1])
    without = EnvironmentProblem(behaviour=parse(walking), env="BipedalWalker-v3")
    assert "[mirror] observation" in without.why_not_mirrored(setup())
    with pytest.raises(ParameterError, match=r"mirror = true: BipedalWalker-v3 is no MuJoCo environment"):
        without.mirror(setup(mirror=True))


def test_the_command_shows_what_the_plan_names(plan, capsys):
    cli.main(["symmetry", str(plan), "--trust"])
    shown = capsys.readouterr().out
    assert "neither derived nor tested" in shown
    assert "2 of 4 numbers change places, 1 change their sign" in shown
    assert "2 of 2 numbers change places, 0 change their sign" in shown
    cli.main(["symmetry", str(plan), "--trust", "--json"])
    assert json.loads(capsys.readouterr().out)["observation"]["sources"] == [0, 2, 1, 3]


def test_it_is_its_own_inverse_whatever_is_named():
    image = NamedImage(swap=((0, 3), (4, 1)), flip=(2, 3, 0)).of(6, "mirror.observation", "it")
    assert image.is_involution
    assert image.sources == (3, 4, 2, 0, 1, 5)
    assert image.signs == (-1, 1, -1, -1, 1, 1)


@pytest.mark.parametrize(
    ("swap", "flip", "said"),
    [
        (((0, 1), (2, 1)), (), "swap: place 1 is there 2 times"),
        (((1, 1),), (), "swap: place 1 is there 2 times"),
        ((), (2, 2), "flip: place 2 is there 2 times"),
        (((0, -1),), (), "swap: places count from 0, got -1"),
        (((0, 1),), (1,), "flip: 1 changes its sign and 0, with which it changes places, does not"),
    ],
)
def test_what_is_no_mirror_is_refused(swap, flip, said):
    with pytest.raises(ParameterError, match=said):
        NamedImage(swap, flip)


@pytest.mark.parametrize(
    ("observation", "action", "said"),
    [
        (
            NamedImage(swap=((1, 4),)),
            NamedImage(),
            r"mirror.observation.swap: there is no place 4; what \S*Rower-v0 observes has 4 numbers, 0 to 3",
        ),
        (NamedImage(), NamedImage(flip=(2,)), r"mirror.action.flip: there is no place 2; .* has 2 numbers"),
    ],
)
@pytest.mark.parametrize("observe", ["nothing", "memory"])
def test_a_place_that_the_robot_does_not_have_is_named(observation, action, said, observe):
    with pytest.raises(ParameterError, match=said):
        problem(NamedMirror(observation, action)).mirror(setup(observe=observe))


class OneWay(gymnasium.ActionWrapper):
    def __init__(self, env):
        super().__init__(env)
        self.action_space = gymnasium.spaces.Box(np.float32([0, -1]), np.float32([1, 1]))

    def action(self, action):
        return action


def test_an_image_with_other_bounds_is_no_image():
    env = OneWay(problem(MIRROR).environment(setup()))
    with pytest.raises(ParameterError, match=r"number 0 .* lies in \[0, 1\], but its image in \[-1, 1\]"):
        MIRROR.of(4, env)
    with pytest.raises(ParameterError, match=r"number 0 .* lies in \[0, 1\], but its image in \[-1, 0\]"):
        NamedMirror(NamedImage(), NamedImage(flip=(0,))).of(4, env)


def one_after_another(works, num_workers, receive, watch):
    for index, work in enumerate(works):
        work.run(lambda progress, index=index: receive(index, progress))


def test_a_plan_holds_it_and_so_does_its_run(plan, tmp_path, monkeypatch):
    monkeypatch.setattr(environment_trainer, "run_lanes", one_after_another)
    experiment = load_plan(plan)
    assert experiment.problem.mirror_image == MIRROR
    again = parse_plan(experiment.to_toml(), "again", described=experiment.behaviour)
    assert again == experiment
    other = parse_plan(PLAN.replace(", flip = [0]", ""), "other", tmp_path)
    assert differences(experiment, other) == ["mirror.observation.flip: [0] → 'absent'"]
    run = run_experiment(experiment, tmp_path / "run", progress=False)
    assert open_run(run.path).experiment.problem.mirror_image == MIRROR
    assert '"mirrored_phases": [false, true, false]' in run.policy("rows", 0).mirror
    with pytest.raises(RunFolderError, match=r"mirror\.observation\.flip"):
        run_experiment(other, run.path, progress=False)


@pytest.mark.parametrize(
    ("line", "instead", "said"),
    [
        ("swap = [[1, 2]]", "swap = [[1, 2, 3]]", r"mirror\.observation\.swap\[0\].*a list of 2"),
        ("swap = [[1, 2]]", 'swap = [[1, "b"]]', r"mirror\.observation\.swap\[0\].*whole number.*'b'"),
        ("swap = [[1, 2]]", "swop = [[1, 2]]", r"mirror\.observation\.swop.*did you mean 'swap'"),
        ("flip = [0]", "flip = [1]", r"mirror\.observation: flip: 1 changes its sign and 2"),
        ("action = { swap = [[0, 1]] }", "", r"mirror lacks 'action'|mirror.*action"),
    ],
)
def test_a_mistake_in_the_table_is_named(plan, line, instead, said):
    with pytest.raises(PlanError, match=said):
        parse_plan(PLAN.replace(line, instead), "rower.toml", plan.parent)


def test_before_anything_is_trained_places_are_looked_at(plan, tmp_path):
    wrong = parse_plan(PLAN.replace("[[0, 1]]", "[[0, 2]]"), "rower.toml", tmp_path)
    with pytest.raises(PlanError, match=r"setup 'rows': mirror\.action\.swap: there is no place 2"):
        run_experiment(wrong, tmp_path / "wrong", progress=False)
    assert not (tmp_path / "wrong" / "policies").exists()


def test_a_description_without_sides_has_no_use_for_it(plan):
    lone = ROWING.replace("mirror left <-> right\n", "").replace(
        "cycle\n  left_ahead -> right_ahead\n",
        "  right_ahead for at most 0.4 s:  left_oar <= right_oar\n\n"
        "cycle\n  left_ahead -> right_ahead -> left_ahead\n",
    )
    with pytest.raises(ParameterError, match=r"mirror: behaviour 'rowing' has no two sides"):
        problem(MIRROR, behaviour=lone)
    (plan.parent / "rowing.behaviour").write_text(lone)
    with pytest.raises(PlanError, match=r"rower\.toml.*mirror: behaviour 'rowing' has no two sides"):
        load_plan(plan)
