import itertools

import pytest

from coachable.behaviours import Behaviour, load_behaviour
from coachable.behaviours.library import SHIPPED
from coachable.errors import BehaviourError

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
    assert all(signal.unit and signal.description for signal in behaviour.signals)
    assert Behaviour.from_json(behaviour.to_json()) == behaviour


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
    for behaviour in SHIPPED.values():
        assert {(edge.source, edge.target): edge.event for edge in behaviour.edges} == {
            ("O1", "O2"): None,
            ("O2", "O3"): None,
            ("O3", "O4"): None,
            ("O4", "O1"): "touchdown",
        }


def test_a_behaviour_is_loaded_from_a_file(tmp_path):
    path = tmp_path / "mine.json"
    path.write_text(load_behaviour("compass-walking").to_json(), encoding="utf-8")
    assert load_behaviour(path) == load_behaviour(str(path)) == load_behaviour("compass-walking")


def test_an_unknown_name_is_refused_with_the_nearest_one():
    with pytest.raises(
        BehaviourError, match=r"'compas-walking' is neither .* did you mean 'compass-walking'\?"
    ):
        load_behaviour("compas-walking")


def test_a_broken_file_is_named(tmp_path):
    path = tmp_path / "broken.json"
    path.write_text('{"name": ', encoding="utf-8")
    with pytest.raises(BehaviourError, match=r"broken\.json: line 1, column 10: not JSON"):
        load_behaviour(path)
    path.write_bytes(b"\xff\xfe\x00")
    with pytest.raises(BehaviourError, match=r"broken\.json: cannot be read as text"):
        load_behaviour(path)
