"""Shares with exact intervals, and labels that say what became of a start."""

import jax
import numpy as np
import pytest

from coachable.plants.compass import START, CompassWalker
from coachable.verification.gait.closed_loop import ClosedLoop
from coachable.verification.robustness.basin import (
    Proportion,
    basin,
    draw_starts,
    label_starts,
    set_names,
)
from tests.verification.conftest import WALKS


@pytest.mark.parametrize("total", [1, 10, 1000])
def test_intervals_of_none_and_of_all_are_known_in_closed_form(total):
    low, high = Proportion(0, total).interval
    assert low == 0
    assert high == pytest.approx(1 - 0.025 ** (1 / total), abs=1e-12)
    low, high = Proportion(total, total).interval
    assert low == pytest.approx(0.025 ** (1 / total), abs=1e-12)
    assert high == 1


def test_an_interval_is_mirrored_with_its_share():
    low, high = Proportion(3, 17).interval
    assert low < 3 / 17 < high
    np.testing.assert_allclose(Proportion(14, 17).interval, (1 - high, 1 - low), atol=1e-12)


def test_starts_are_in_their_boxes_and_always_the_same():
    plant = CompassWalker()
    around, section = (draw_starts(plant, name, 200) for name in set_names(plant))
    np.testing.assert_array_equal(around, draw_starts(plant, "start", 200))
    assert (np.abs(around - START) <= plant.start_box).all()
    np.testing.assert_array_equal(section[:, 0], -section[:, 1])
    low, high = np.array(plant.section_box).T
    assert ((section[:, [0, 2, 3]] >= low) & (section[:, [0, 2, 3]] <= high)).all()


def test_labels_say_what_became_of_a_start(settled):
    walk, _ = settled["free"]
    gait = walk.section[-64:]
    beta, stance, swing = gait[0]
    starts = np.array([(beta, -beta, stance, swing), START, (0.3, -0.3, 1.5, 0.0)])
    loop, told = ClosedLoop(CompassWalker(), WALKS), []
    labels = label_starts(loop, "free", gait, starts, lambda: told.append(1))
    assert labels.tolist() == [0, 0, 1]
    elsewhere = label_starts(loop, "free", gait + 1.0, starts)
    assert elsewhere.tolist() == [2, 2, 1]
    assert told == [1]
    found = basin("start", labels)
    assert (found.reached.count, found.fell.count, found.undecided.count) == (2, 1, 0)
    assert not jax.config.jax_enable_x64
