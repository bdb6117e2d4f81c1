"""What a description says of its two sides: which phase and which signal is whose mirror image."""

from pathlib import Path

import pytest

from coachable.behaviours import load_behaviour
from coachable.behaviours.behaviour import Symmetry
from coachable.behaviours.text.parser import parse
from coachable.behaviours.text.printer import to_text

ROOT = Path(__file__).parents[2]
MIRRORED = ["perry-gait", *sorted(map(str, (ROOT / "experiments" / "walker2d").glob("*.behaviour")))]

SWAY = """
behaviour "sway"

signals
  sway                 [m]    of the pelvis, to the left
  sway_rate = d/dt sway  [m/s]
  left_foot_y          [m]    to the left of its hip
  right_foot_y         [m]    to the left of its hip
  height               [m]

mirror left <-> right, sway -> -sway, left_foot_y -> -right_foot_y

phases
  left_down:  sway > 0.1, sway_rate < 0, left_foot_y > 0.2
  both_down:  sway between -0.1 and 0.1, height > 1

cycle
  left_down -> both_down -> right_down -> both_down -> left_down
""".replace("sway between -0.1 and 0.1", "-0.1 <= sway <= 0.1")


def test_phases_know_their_images_and_the_half_that_was_left_to_the_mirror():
    behaviour = parse(SWAY)
    assert behaviour.symmetry == Symmetry((("left", "right"),), ("sway", "left_foot_y"))
    assert behaviour.phase_names == ("left_down", "both_down", "right_down")
    assert behaviour.phase_images == (2, 1, 0)
    assert behaviour.mirrored_phases == (False, False, True)


def test_signals_know_their_images_and_signs():
    behaviour = parse(SWAY)
    assert {name: behaviour.signal_image(name) for name in behaviour.signal_names} == {
        "sway": ("sway", -1),
        "sway_rate": ("sway_rate", -1),
        "left_foot_y": ("right_foot_y", -1),
        "right_foot_y": ("left_foot_y", -1),
        "height": ("height", 1),
    }


def test_without_a_mirror_all_is_its_own_image():
    behaviour = load_behaviour("compass-walking")
    assert behaviour.symmetry is None
    assert behaviour.phase_images == (0, 1, 2, 3)
    assert not any(behaviour.mirrored_phases)
    assert behaviour.signal_image("theta_1") == ("theta_1", 1)


@pytest.mark.parametrize("name", MIRRORED, ids=lambda name: Path(name).stem)
def test_the_text_of_a_behaviour_with_two_sides_is_an_equal_behaviour(name):
    behaviour = load_behaviour(name)
    assert parse(to_text(behaviour)) == behaviour
    half = sum(behaviour.mirrored_phases)
    assert 2 * half == sum(image != index for index, image in enumerate(behaviour.phase_images))


def test_the_text_of_one_with_flips_is_an_equal_behaviour():
    behaviour = parse(SWAY)
    assert "mirror left <-> right, sway -> -sway, left_foot_y -> -right_foot_y" in to_text(behaviour)
    assert parse(to_text(behaviour)) == behaviour


def test_an_image_of_an_image_is_the_original():
    for behaviour in (parse(SWAY), load_behaviour("perry-gait")):
        images = behaviour.phase_images
        assert [images[image] for image in images] == [*range(len(images))]
        for name in behaviour.signal_names:
            image, sign = behaviour.signal_image(name)
            assert behaviour.signal_image(image) == (name, sign)
