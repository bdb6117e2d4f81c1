"""`coachable verify` in Gymnasium environments: a stick that is balanced, and a published run of Walker2d."""

import json
import shutil
from pathlib import Path

import gymnasium
import jax.numpy as jnp
import numpy as np
import pytest
from safetensors.numpy import save

from coachable import cli
from coachable.behaviours.text.parser import parse
from coachable.envs.own_reward import OwnReward
from coachable.experiments.plan import parse_plan
from coachable.experiments.run_folder.reader import open_run
from coachable.experiments.run_folder.writer import RunFolder
from coachable.foundation.errors import ParameterError, RunFolderError
from coachable.learning.policy import Policy
from coachable.verification.falsification.episode_counterexample import (
    load_fallen_episode,
    write_episode_counterexamples,
)
from coachable.verification.falsification.episode_falls import (
    EpisodeCounterexample,
    EpisodeFalsification,
    HeldPushes,
    VelocityKick,
)
from coachable.verification.falsification.fall_search import Fall, SearchResult
from coachable.verification.passport import attempts, episodes
from coachable.verification.passport.closed_loop import lane_subject
from coachable.verification.passport.passport import passport_data, read_passport
from coachable.verification.passport.verify import verify
from coachable.verification.robustness import episode_pushes
from coachable.verification.robustness.disturbed_episode import (
    DisturbedEnv,
    EpisodeDisturbance,
    EpisodeEnd,
    EpisodeLoop,
)

WALKER2D = Path(__file__).parents[3] / "docs" / "results" / "walker2d" / "walk"

SWAYING = """
behaviour "swaying"

signals
  angle        from upright
  speed        angular velocity

phases
  left:   angle < 0
  right:  angle >= 0

cycle
  left -> right -> left
"""

PLAN = """
env = "tests/Stick-v0"
behaviour = "swaying.behaviour"
steps = 64
evaluate_every = 64
seeds = { first = 0, count = 2 }
[signals]
angle = 0
speed = 1
[setups.alone]
weight = 0
[sb3]
n_steps = 64
"""


class Stick(gymnasium.Env):
    """An inverted pendulum, linearised, that falls at 0.5 rad; an episode has 40 steps of 0.05 s."""

    dt = 0.05

    def __init__(self):
        self.observation_space = gymnasium.spaces.Box(-np.inf, np.inf, (2,))
        self.action_space = gymnasium.spaces.Box(-1.0, 5.0, (1,))
        self.applied = []

    def reset(self, *, seed=None, options=None):
        super().reset(seed=seed)
        self.state, self.applied = self.np_random.uniform(-0.1, 0.1, 2), []
        return self.state.astype(np.float32), {}

    def step(self, action):
        self.applied.append(float(action[0]))
        angle, speed = self.state
        self.state = self.state + self.dt * np.array([speed, 12 * angle + action[0]])
        fell = bool(abs(self.state[0]) > 0.5)
        return self.state.astype(np.float32), 1 - abs(float(self.state[0])), fell, False, {}


@pytest.fixture(scope="module", autouse=True)
def registered():
    gymnasium.register("tests/Stick-v0", Stick, max_episode_steps=40)
    yield
    del gymnasium.registry["tests/Stick-v0"]


@pytest.fixture(autouse=True)
def small(monkeypatch):
    """Few episodes, and no change to JAX's configuration for the tests that follow."""
    from coachable.experiments import runner

    monkeypatch.setattr(episodes, "NUM_EPISODES", 4)
    monkeypatch.setattr(episode_pushes, "NUM_EPISODES", 6)
    monkeypatch.setattr(attempts, "EPISODE_BUDGET", 20)
    monkeypatch.setattr(runner, "set_up_jax", lambda: None)


def feedback(gain):
    """u = −gain (angle + speed / 2), in the range of the stick's actions."""
    return Policy(
        weights=(jnp.array([[-gain, -gain / 2]], jnp.float32),),
        biases=(jnp.zeros(1, jnp.float32),),
        low=jnp.array([-1.0], jnp.float32),
        high=jnp.array([5.0], jnp.float32),
    )


@pytest.fixture(scope="module")
def run(registered, tmp_path_factory):
    """Seed 0 balances the stick, seed 1 lets it fall."""
    path = tmp_path_factory.mktemp("runs") / "stick"
    path.mkdir()
    folder = RunFolder.begin(path, parse_plan(PLAN, "plan", described=parse(SWAYING)), (2,), None)
    for seed, policy in enumerate((feedback(40.0), feedback(-20.0))):
        folder.write(f"policies/alone-{seed}-last.safetensors", save(policy.tensors()))
        folder.write(f"policies/alone-{seed}-last.json", json.dumps(policy.description()))
    return open_run(path)


def call(capsys, *arguments):
    try:
        cli.main([*map(str, arguments)])
        status = 0
    except SystemExit as stopped:
        status = stopped.code
    out, err = capsys.readouterr()
    return out, err, status


def steps(disturbance, actions):
    """What the stick's motor gets of these actions, and where the stick comes to."""
    stick = Stick()
    env = DisturbedEnv(OwnReward(stick, {}), disturbance)
    env.reset(seed=0)
    states = [env.step(np.array([action], np.float32))[0] for action in actions]
    return stick.applied, np.array(states)


def test_no_disturbance_changes_nothing():
    actions = [0.0, 1.0, -1.0]
    applied, states = steps(EpisodeDisturbance(), actions)
    stick = Stick()
    stick.reset(seed=0)
    assert applied == actions
    np.testing.assert_array_equal(states, [stick.step([action])[0] for action in actions])


def test_a_push_is_in_halves_of_the_range_and_cut_to_it():
    push = np.array([[0.5], [9.0], [-9.0]])
    applied, _ = steps(EpisodeDisturbance(begin=1, push=push), [0.0, 1.0, 0.0, 0.0, 1.0])
    assert applied == [0.0, 1.0 + 0.5 * 3.0, 5.0, -1.0, 1.0]


def test_moments_are_within_the_time_that_the_environment_gives_an_episode(run):
    loop = EpisodeLoop.of(run, "alone", 0)
    assert loop.num_steps(0.2) == 4
    assert loop.num_steps(10.0) == 40


def test_late_actions_are_those_of_the_step_before():
    applied, _ = steps(EpisodeDisturbance(delay=True), [0.5, 1.0, 2.0])
    assert applied == [0.5, 0.5, 1.0]


def test_a_robot_gets_its_passport_without_a_section(run, tmp_path, capsys):
    out, _, status = call(capsys, "verify", run.path, "--seed", 0, "--out", tmp_path, "--certify")
    assert status == 0
    for words in ("4 of 4 episodes", "tests/Stick-v0, level quick", "no section: the physics of", "cycles"):
        assert words in out
    passport = read_passport(tmp_path / "alone-0.json")
    seen = passport.adherence
    assert passport.walks
    assert (seen.episodes.count, seen.episodes.total, seen.up) == (4, 4, True)
    assert seen.seconds == pytest.approx(4 * 40 * 0.05)
    assert seen.share_in_phases == pytest.approx(sum(seen.phases.values())) == pytest.approx(1)
    assert passport.orbits is passport.stability is passport.pushes is None
    assert passport.basins == passport.falls == ()
    assert not passport.certificate.proven
    assert passport.walker.no_section in passport.certificate.reason
    assert (tmp_path / "alone-0-automaton.svg").exists()


@pytest.fixture(scope="module")
def whole(run, tmp_path_factory):
    """The passport at level full of the robot that balances, and the shares of the work as reported."""
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(episodes, "NUM_EPISODES", 2)
        patch.setattr(episode_pushes, "NUM_EPISODES", 6)
        patch.setattr(attempts, "EPISODE_BUDGET", 64)
        done = []
        (passport,) = verify(
            [lane_subject(run, "alone", 0)],
            "full",
            run.path / "passports",
            progress=lambda name, share: done.append(share),
        )
    return passport, done


def test_what_is_survived_is_counted_and_the_tolerance_follows_from_it(whole):
    passport, done = whole
    assert sum(done) == pytest.approx(1)
    undisturbed, *pushed, late = passport.pushes.survival
    assert [one.up.total for one in passport.pushes.survival] == [6] * 6
    assert undisturbed.up.count == 6
    assert [one.amount for one in pushed] == list(episode_pushes.AMOUNTS)
    assert pushed[-1].up.count < 6, "a push over the whole range for 0.2 s makes it fall"
    survived = [one.amount for one in pushed if one.up.count == 6]
    (tolerance,) = passport.pushes.tolerances
    assert tolerance.amount == max(survived, default=0.0)
    assert passport.pushes.delay_survived == (late.up.count == 6)


def test_the_passport_comes_back_as_it_was_with_the_reason_why_there_is_no_section(run, whole):
    passport, _ = whole
    path = run.path / "passports" / "alone-0.json"
    assert passport_data(read_passport(path)) == passport_data(passport)
    data = json.loads(path.read_text(encoding="utf-8"))
    assert data["orbits"] is data["stability"] is data["walker"]["semantics"] is None
    assert data["walker"]["no_section"] == passport.walker.no_section
    assert data["pushes"]["survival"][0]["up"]["share"] == 1


def test_a_fall_is_found_shrunk_and_falls_again(run, whole):
    passport, _ = whole
    (search,) = passport.falls
    assert search.confirmed >= 1
    assert search.unconfirmed == 0
    assert search.least_margin <= 0
    paths = sorted((run.path / "counterexamples").glob("*.json"))
    assert [path.name for path in paths] == [
        f"alone-0-{number}.json" for number in range(1, search.confirmed + 1)
    ]
    for path in paths:
        fallen = load_fallen_episode(path)
        end = fallen.again()
        assert end.fell
        assert end.seconds == fallen.falls_after <= 2.0
        assert np.max(np.abs(fallen.disturbance.push)) <= HeldPushes().bound
    loop = EpisodeLoop.of(run, "alone", 0)
    fallen = load_fallen_episode(paths[0])
    weaker = EpisodeDisturbance(push=0.5 * fallen.disturbance.push)
    assert not loop.run(fallen.episode, weaker, 10.0).fell


def test_a_counterexample_of_another_policy_is_refused(run, whole, tmp_path):
    (tmp_path / "run").mkdir()
    copy = shutil.copytree(run.path, tmp_path / "run", dirs_exist_ok=True)
    (copy / "policies" / "alone-0-last.safetensors").write_bytes(save(feedback(39.0).tensors()))
    with pytest.raises(RunFolderError, match=r"about another policy .* verify the run again"):
        load_fallen_episode(copy / "counterexamples" / "alone-0-1.json")


def test_a_kick_is_read_as_it_was_written_and_refused_by_a_robot_without_velocities(run, tmp_path):
    copy = open_run(shutil.copytree(run.path, tmp_path / "run"))
    fall = Fall("random", np.array([0.5, -1.0]), 0.1)
    search = SearchResult("random", 1, -1.0, 1, (fall,))
    kick = EpisodeDisturbance(kick=fall.point)
    seen = EpisodeCounterexample(fall, kick, EpisodeEnd(2, 0.1, True, 0.0))
    found = EpisodeFalsification(VelocityKick(), 0, 1.0, (search, search), (seen,), ())
    (path,) = write_episode_counterexamples(copy.path, "kicked", copy, copy.lane("alone", 0), "last", [found])
    again = load_fallen_episode(path)
    np.testing.assert_array_equal(again.disturbance.kick, kick.kick)
    assert len(again.disturbance.push) == 0
    with pytest.raises(ParameterError, match="the kick has 2 numbers, but the robot takes 0"):
        again.again()
    data = json.loads(path.read_text(encoding="utf-8"))
    path.write_text(json.dumps(data | {"push": [[1.0], [1.0, 2.0]]}), encoding="utf-8")
    with pytest.raises(RunFolderError, match="the rows of push are not of one length"):
        load_fallen_episode(path)


def test_a_robot_that_always_falls_is_not_disturbed(run, tmp_path, capsys):
    out, _, status = call(
        capsys, "verify", run.path, "--seed", 1, "--level", "full", "--out", tmp_path, "--json"
    )
    data = json.loads(out)
    assert status == 0
    assert data["adherence"]["episodes"]["count"] == 0
    assert data["adherence"]["up"] is False
    assert data["pushes"] is None
    assert data["falls"] == []


def test_all_lanes_are_in_one_table_and_not_verified_twice(run, tmp_path, capsys):
    out, _, status = call(capsys, "verify", run.path, "--all", "--out", tmp_path)
    assert status == 0
    (row,) = (line.split() for line in out.splitlines() if line.strip().startswith("alone "))
    assert row[1:4] == ["2", "1", "50.0"]  # walkers, up in every episode, percentage of the episodes
    table = json.loads((tmp_path / "summary.json").read_text(encoding="utf-8"))
    assert {len(line) for line in (table["header"], *table["rows"])} == {8}
    assert "no section" in table["note"]
    again, err, _ = call(capsys, "verify", run.path, "--all", "--out", tmp_path)
    assert "2 of 2 passports are there already" in err
    assert again == out


@pytest.fixture(scope="module")
def walker2d():
    pytest.importorskip("mujoco", reason="needs the [mujoco] extra: pip install 'coachable[mujoco]'")
    return EpisodeLoop.of(open_run(WALKER2D), "both", 0)


def test_a_kick_changes_the_velocities_of_a_mujoco_robot_once(walker2d):
    assert walker2d.num_velocities == 9
    kick = np.linspace(-0.4, 0.4, 9)
    base, seen = walker2d.env.unwrapped, []

    class Watched(gymnasium.Wrapper):
        def step(self, action):
            seen.append(base.data.qvel.copy())
            return self.env.step(action)

    for given in (None, kick):
        env = DisturbedEnv(Watched(walker2d.env), EpisodeDisturbance(begin=2, kick=given))
        env.reset(seed=0)
        for _ in range(4):
            env.step(np.zeros(6, np.float32))
    for number in (0, 1):
        np.testing.assert_array_equal(seen[number], seen[4 + number])
    np.testing.assert_allclose(seen[4 + 2] - seen[2], kick)
    assert not np.allclose(seen[4 + 3] - seen[3], 2 * kick)


def test_walker2d_has_pushes_and_kicks(walker2d, monkeypatch):
    monkeypatch.setattr(episode_pushes, "NUM_EPISODES", 1)
    monkeypatch.setattr(episode_pushes, "AMOUNTS", (0.5,))
    monkeypatch.setattr(episode_pushes, "SECONDS", 0.4)
    found = episode_pushes.episode_pushes(walker2d)
    assert [one.unit for one in found.tolerances] == ["half ranges", "m/s, rad/s"]
    assert len(found.survival) == 4
    assert walker2d.run(0, EpisodeDisturbance(), 0.4) == walker2d.run(0, EpisodeDisturbance(), 0.4)
