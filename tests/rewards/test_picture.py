import itertools
import xml.etree.ElementTree as ET

import pytest

from coachable.behaviours import load_behaviour
from coachable.rewards.forms import VARIANTS, reward_table
from coachable.rewards.picture import reward_svg
from tests.diagram.pictures import BEHAVIOURS, boxes, elements

WALKING = BEHAVIOURS["walking"]


@pytest.mark.parametrize("variant", VARIANTS)
@pytest.mark.parametrize("name", ["walking", "gait", "one phase", "hop"])
def test_the_table_is_what_the_reward_pays(name, variant):
    behaviour = BEHAVIOURS[name]
    svg = reward_svg(behaviour, variant)
    cells = [text for text in elements(svg, "text") if (text.get("class") or "").startswith("pay ")]
    # From the top left to the bottom right.
    cells.sort(key=lambda text: (float(text.get("y") or 0), float(text.get("x") or 0)))
    paid = [1 if "".join(text.itertext()) == "+1" else -1 for text in cells]
    assert paid == reward_table(behaviour, variant).ravel().tolist()
    assert len(elements(svg, "rect", "cell-paid")) == paid.count(1)


@pytest.mark.parametrize(
    ("variant", "paid", "punished"), [("stay", 12, 8), ("equation", 8, 12), ("released", 7, 13)]
)
def test_the_arrows_are_the_papers(variant, paid, punished):
    # Four phases: staying, an edge, its reverse, entering and leaving, each four times.
    svg = reward_svg(WALKING, variant)
    assert len(elements(svg, "path", "paid")) == paid
    assert len(elements(svg, "path", "punished")) == punished


def test_the_schedule_pays_where_it_is_expected_and_for_going_on():
    svg = reward_svg(load_behaviour("compass-walking-timed"), "schedule")
    texts = ["".join(text.itertext()) for text in elements(svg, "text")]
    assert "expected ↓ in →" in texts
    cells = [text for text in elements(svg, "text") if (text.get("class") or "").startswith("pay ")]
    cells.sort(key=lambda text: (float(text.get("y") or 0), float(text.get("x") or 0)))
    paid = ["".join(text.itertext()) == "+1" for text in cells]
    # Staying, the next phase, and beginning anywhere.
    ring = [[1, 1, 0, 0, 0], [0, 1, 1, 0, 0], [0, 0, 1, 1, 0], [1, 0, 0, 1, 0], [1, 1, 1, 1, 0]]
    assert paid == [bool(pays) for row in ring for pays in row]


@pytest.mark.parametrize("name", BEHAVIOURS)
def test_nothing_lies_on_anything_else(name):
    svg = reward_svg(BEHAVIOURS[name])
    drawn = [
        *boxes(svg, "node"),
        *boxes(svg, "nowhere"),
        *boxes(svg, "cell-paid"),
        *boxes(svg, "cell-punished"),
    ]
    for one, other in itertools.combinations(drawn, 2):
        assert not one.overlaps(other)
    x, y, width, height = map(float, ET.fromstring(svg).attrib["viewBox"].split())
    for box in drawn:
        assert x < box.x - box.width / 2 < box.x + box.width / 2 < x + width
        assert y < box.y - box.height / 2 < box.y + box.height / 2 < y + height
