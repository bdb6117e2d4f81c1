"""Nothing in a picture lies on anything else, whatever the behaviour."""

import itertools
import math
import xml.etree.ElementTree as ET

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from coachable.diagram.draw import automaton_svg
from coachable.diagram.layout import Box, Ring
from coachable.diagram.lettering import SIZES
from coachable.diagram.routing import routes
from tests.diagram.pictures import (
    BEHAVIOURS,
    around,
    boxes,
    curve_points,
    drawn,
    elements,
    graph,
    text_boxes,
)


def assert_clear(svg):
    nodes, labels = boxes(svg, "node"), boxes(svg, "clearing")
    for one, other in itertools.combinations([*nodes, *labels], 2):
        assert not one.overlaps(other)
    x, y, width, height = map(float, ET.fromstring(svg).attrib["viewBox"].split())
    for box in [*nodes, *labels]:
        assert x < box.x - box.width / 2 < box.x + box.width / 2 < x + width
        assert y < box.y - box.height / 2 < box.y + box.height / 2 < y + height
    for text in text_boxes(svg, SIZES):
        # Inside the box that was made for it, in about the widest font that a reader may have.
        assert any(
            abs(text.x - box.x) + text.width / 2 <= box.width / 2 + 2
            and abs(text.y - box.y) <= box.height / 2
            for box in [*nodes, *labels]
        )
    for path in elements(svg, "path", "edge"):
        for point in list(curve_points(path))[2:-2]:
            assert not any(
                abs(point[0] - box.x) <= box.width / 2 - 2 and abs(point[1] - box.y) <= box.height / 2 - 2
                for box in [*nodes, *labels]
            )


@pytest.mark.parametrize("name", BEHAVIOURS)
def test_nothing_lies_on_anything_else(name):
    behaviour = BEHAVIOURS[name]
    svg = drawn(name)
    assert len(boxes(svg, "node")) == len(behaviour.phases)
    assert len(elements(svg, "path", "edge")) == len({(edge.source, edge.target) for edge in behaviour.edges})
    assert_clear(svg)


@pytest.mark.parametrize("name", BEHAVIOURS)
def test_a_picture_is_readable_at_the_width_of_a_readme(name):
    width = float(ET.fromstring(drawn(name)).attrib["width"])
    # The smallest letters are 12 px; on 800 px they are 9 px at least.
    assert width <= 1060


@settings(max_examples=12)
@given(st.data())
def test_random_graphs_are_drawn_clear(data):
    count = data.draw(st.integers(1, 9))
    ends = st.tuples(st.integers(0, count - 1), st.integers(0, count - 1))
    chords = data.draw(st.lists(ends, max_size=6, unique=True))
    event = data.draw(st.sampled_from([None, "go", "a longer event"]))
    pairs = dict.fromkeys((*(around(count) if count > 1 else []), *chords))
    assert_clear(automaton_svg(graph(count, *pairs, event=event)))


@pytest.mark.parametrize("count", range(1, 17))
def test_boxes_stand_apart_and_left_and_right_are_alike(count):
    ring = Ring.of(count, 250.0, 120.0)
    for one, other in itertools.combinations(ring.boxes, 2):
        assert not one.overlaps(other, (50.0, 44.0))
    assert ring.boxes[0].y == min(box.y for box in ring.boxes)
    places = {(round(box.x), round(box.y)) for box in ring.boxes}
    assert {(-x, y) for x, y in places} == places
    turns = [math.atan2(box.y, box.x) for box in ring.boxes]
    assert sum((later - turn) % (2 * math.pi) < 0 for turn, later in itertools.pairwise(turns)) == 0


@pytest.mark.parametrize("count", [1, 2, 3, 6])
def test_every_arrow_goes_from_border_to_border(count):
    ring = Ring.of(count, 250.0, 120.0)
    pairs = list(itertools.product(range(count), repeat=2))

    def off(box: Box, point):
        return max(abs(point[0] - box.x) - box.width / 2, abs(point[1] - box.y) - box.height / 2)

    for (source, target), arrow in routes(ring, pairs).items():
        assert off(ring.boxes[source], arrow.points[0]) == pytest.approx(0, abs=3)
        assert off(ring.boxes[target], arrow.points[-1]) == pytest.approx(1.5, abs=2)
