import itertools
from pathlib import Path

import pytest

from coachable.behaviours import load_behaviour
from coachable.behaviours.checking.checker import check
from coachable.behaviours.library import LIBRARY, SHIPPED
from coachable.behaviours.text.document import formatted_file
from coachable.behaviours.text.parser import parse
from coachable.behaviours.text.printer import to_text
from coachable.diagram.draw import automaton_svg
from coachable.envs.signals import SIGNAL_PACKS
from coachable.foundation.errors import BehaviourError
from coachable.rewards.expected_run import has_expected_run
from coachable.rewards.reward_hash import reward_hash
from coachable.rewards.setup import PAPER_SETUPS

STATES: list[dict[str, float]] = [
    dict(zip(("theta_1", "theta_2", "dtheta_1", "dtheta_2"), values, strict=True))
    for values in itertools.product((-0.3, -0.0, 0.0, 0.2), repeat=4)
]


@pytest.mark.parametrize("name", SHIPPED)
def test_every_shipped_behaviour_keeps_the_contract(name):
    behaviour = load_behaviour(name)
    assert behaviour.name == name
    assert behaviour.description
    assert all(phase.title for phase in behaviour.phases)
    for signal in behaviour.signals:
        assert signal.description
        assert signal.unit or "else 0" in signal.description or "share" in signal.description
    assert behaviour.cycles
    assert parse(to_text(behaviour)) == behaviour


def test_the_names_are_those_of_the_files():
    assert list(SHIPPED) == sorted(path.stem for path in LIBRARY.glob("*.behaviour"))


@pytest.mark.parametrize("path", sorted(LIBRARY.iterdir()), ids=lambda path: path.name)
def test_every_shipped_file_is_formatted(path):
    text, formatted = formatted_file(path)
    assert text == formatted


# From the description in Python that the files replaced.
REWARDS = {
    "compass-walking": "f0143aaa164259efb60c19caca71d37b7231e2f1750e6da1d9686899ce988a6d",
    "compass-walking-released": "302cfcc5d42707cb9e261544d6c3b5753da5e41419a349da8f18dec21e7a23b7",
}
TITLES = {
    "O1": "swing leg behind the hip",
    "O2": "swing leg ahead of the hip",
    "O3": "hip ahead of the stance foot",
    "O4": "swing leg comes back",
}


@pytest.mark.parametrize("name", REWARDS)
def test_ideal_walking_is_what_it_was_in_python(name):
    behaviour = load_behaviour(name)
    assert reward_hash(behaviour, "stay", "paper", PAPER_SETUPS["orthant"]) == REWARDS[name]
    assert {phase.name: phase.title for phase in behaviour.phases} == TITLES
    assert behaviour.signal_names == ("theta_1", "theta_2", "dtheta_1", "dtheta_2")
    assert behaviour.signals[2].derivative_of == "theta_1"
    assert behaviour.cycles == (behaviour.edges,)


def test_the_fifth_phase_is_the_orthant_right_after_touchdown():
    behaviour = load_behaviour("compass-walking-five-phases")
    four = load_behaviour("compass-walking")
    for state in STATES:
        fifth = all(
            (state["theta_1"] > 0, state["theta_2"] <= 0, state["dtheta_1"] <= 0, state["dtheta_2"] <= 0)
        )
        assert behaviour.phase_at(state) == ("O5" if fifth else four.phase_at(state))
    assert [str(edge) for edge in behaviour.edges[3:]] == ["O4 → O5 on touchdown", "O5 → O1"]


def test_the_human_gait_is_symmetric_and_tells_every_phase_of_each_leg():
    gait = load_behaviour("perry-gait")
    titles = " ".join(phase.title for phase in gait.phases)
    for side in ("left", "right"):
        for phase in ("loading response", "mid stance", "terminal stance"):
            assert f"{side} {phase}" in titles
        for phase in ("pre-swing", "initial swing", "mid swing", "terminal swing"):
            assert f"{side} {phase}" in titles
    (cycle,) = gait.cycles
    assert len(cycle) == len(gait.phases) == 10
    swap = {"left": "right", "right": "left"}
    for values in itertools.product(
        (-0.3, 0.3), (-0.1, 0.4), (-0.2, 0.2), (0.0, 0.3), (0.0, 300.0), (0.0, 300.0)
    ):
        ahead, behind, shank, sole, left, right = values
        state = {
            "left_foot_x": ahead,
            "right_foot_x": behind,
            "left_shank": shank,
            "right_shank": 0.1,
            "left_sole": 0.0,
            "right_sole": sole,
            "left_load": left,
            "right_load": right,
        }
        mirrored = {
            f"{swap[side]}_{rest}": state[f"{side}_{rest}"]
            for side, _, rest in (n.partition("_") for n in state)
        }
        here, there = gait.phase_at(state), gait.phase_at(mirrored)
        assert (here is None) == (there is None)
        if here and there:
            side, _, rest = here.partition("_")
            assert there == f"{swap[side]}_{rest}"


def as_printed(theta_1, theta_2, dtheta_1, dtheta_2):
    """μ₂ of the paper, eqs. (mu-2-a) to (mu-2-b), copied symbol by symbol."""
    if theta_1 > 0 and theta_2 <= 0 and dtheta_1 <= 0 and dtheta_2 > 0:
        return "O1"
    if theta_1 > 0 and theta_2 > 0 and dtheta_1 <= 0 and dtheta_2 > 0:
        return "O2"
    if theta_1 <= 0 and theta_2 > 0 and dtheta_1 <= 0 and dtheta_2 > 0:
        return "O3"
    if theta_1 <= 0 and theta_2 > 0 and dtheta_1 <= 0 and dtheta_2 <= 0:
        return "O4"
    return None


def as_released(theta_1, theta_2, dtheta_1, dtheta_2):
    """`find_orthant` of the released code: the sign of every coordinate must match, and that of 0 is 0."""
    signs = tuple((value > 0) - (value < 0) for value in (theta_1, dtheta_1, theta_2, dtheta_2))
    orthants = {(1, -1, -1, 1): "O1", (1, -1, 1, 1): "O2", (-1, -1, 1, 1): "O3", (-1, -1, 1, -1): "O4"}
    return orthants.get(signs)


@pytest.mark.parametrize(
    ("name", "transcription"), [("compass-walking", as_printed), ("compass-walking-released", as_released)]
)
def test_phases_are_the_orthants_at_every_combination_of_signs_and_zeros(name, transcription):
    behaviour = load_behaviour(name)
    assert {behaviour.phase_at(state) for state in STATES} == {"O1", "O2", "O3", "O4", None}
    for state in STATES:
        assert behaviour.phase_at(state) == transcription(**state), state


def test_the_edges_are_the_cycle_and_its_last_one_is_taken_at_touchdown():
    for name in REWARDS:
        behaviour = load_behaviour(name)
        assert {(edge.source, edge.target): edge.event for edge in behaviour.edges} == {
            ("O1", "O2"): None,
            ("O2", "O3"): None,
            ("O3", "O4"): None,
            ("O4", "O1"): "touchdown",
        }


def test_a_behaviour_is_loaded_from_a_file(tmp_path):
    path = tmp_path / "mine.behaviour"
    path.write_text(to_text(load_behaviour("compass-walking")), encoding="utf-8")
    assert load_behaviour(path) == load_behaviour(str(path)) == load_behaviour("compass-walking")


def test_an_unknown_name_is_refused_with_the_nearest_one():
    with pytest.raises(
        BehaviourError, match=r"'compas-walking' is neither .* did you mean 'compass-walking'\?"
    ):
        load_behaviour("compas-walking")


def test_a_broken_file_is_named(tmp_path):
    path = tmp_path / "broken.behaviour"
    path.write_text('behaviour "x\n', encoding="utf-8")
    with pytest.raises(BehaviourError, match=r"broken\.behaviour:1:11: '\"' is not expected here"):
        load_behaviour(path)
    path.write_bytes(b'behaviour "x"\n  \xff\xfe\x00')
    with pytest.raises(BehaviourError, match=r"broken\.behaviour:2:3: .* byte 0xff is not UTF-8"):
        load_behaviour(path)
    path.write_bytes(b" " * 300_000)
    with pytest.raises(BehaviourError, match=r"broken\.behaviour has more than 262144 bytes"):
        load_behaviour(path)
    for nothing in (tmp_path, "/dev/zero", "a\0b"):
        with pytest.raises(BehaviourError, match=r"neither a behaviour that ships nor a file"):
            load_behaviour(nothing)


GALLERY = Path(__file__).parents[2] / "docs" / "behaviours.md"
PICTURES = sorted(GALLERY.with_suffix("").glob("*.svg"))


@pytest.mark.parametrize("path", PICTURES, ids=lambda path: path.stem)
def test_the_gallery_shows_the_behaviours_as_they_are(path):
    assert path.read_text(encoding="utf-8") == automaton_svg(load_behaviour(path.stem))
    assert f"(behaviours/{path.name})" in GALLERY.read_text(encoding="utf-8")


TWO_FEET = ("Walker2d-v5", "Humanoid-v5", "BipedalWalker-v3")
FOR = {
    **dict.fromkeys(("walk", "walk-backwards", "run", "skip"), TWO_FEET),
    **dict.fromkeys(("trot", "pace"), ("Ant-v5",)),
    "bound": ("HalfCheetah-v5",),
    "hop": tuple(SIGNAL_PACKS),
}


@pytest.mark.parametrize(
    ("name", "robot"), [(name, robot) for name, robots in FOR.items() for robot in robots]
)
def test_the_robots_of_a_behaviour_have_its_signals_in_its_units(name, robot):
    has = {signal.name: signal.unit for signal in SIGNAL_PACKS[robot].signals}
    behaviour = load_behaviour(name)
    assert {signal.name: has.get(signal.name) for signal in behaviour.signals} == {
        signal.name: signal.unit for signal in behaviour.signals
    }


@pytest.mark.parametrize("name", FOR)
def test_the_schedule_can_pay_for_them_and_a_check_finds_nothing_to_change(name):
    behaviour = load_behaviour(name)
    assert has_expected_run(behaviour)
    assert check(behaviour).passes(strict=True)
