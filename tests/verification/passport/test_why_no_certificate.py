"""Why there is nothing to certify is told: what the walker does, and the gait that it does not keep to."""

from dataclasses import replace

import jax
import numpy as np
import pytest

from coachable.plants.compass import START
from coachable.verification.gait.closed_loop import stacked
from coachable.verification.gait.orbit import find_orbits
from coachable.verification.gait.stability import stabilities
from coachable.verification.gait.walk import settle
from coachable.verification.passport.why_no_certificate import obstacles
from tests.verification.conftest import FALLS, TWO_STEPS, WALKS, loop_of, small_policy

ALWAYS_CLIPPED = small_policy(12, 0.2, ankle=9.0, hip=9.0)


@pytest.fixture(scope="module")
def seen():
    """Four walkers under the touchdown clock: loops, walks, orbits, stability."""
    with jax.enable_x64(True):
        loops = stacked([loop_of(policy) for policy in (WALKS, TWO_STEPS, FALLS, ALWAYS_CLIPPED)])
        walks = settle(loops, np.tile(np.array(START), (4, 1)), "touchdown")
        orbits = find_orbits(loops, walks, "touchdown")
        return loops, walks, orbits, stabilities(loops, orbits)


def told(*seen):
    with jax.enable_x64(True):
        return obstacles(*seen)


def test_nothing_keeps_a_stable_gait_from_a_certificate(seen):
    walks, two_steps, falls, clipped = told(*seen)
    assert walks == two_steps == ""
    assert falls.startswith(f"it falls after {seen[1][2].seconds:.2f} s")
    assert clipped.endswith("both torques stay at a bound: nothing is fed back")


def test_where_no_gait_was_settled_to_the_one_nearby_is_told(seen):
    """As if they had not settled: the one is at a gait that holds, the other has doubled its period."""
    loops, walks, orbits, _ = seen
    unsettled = [*(replace(orbit, kind="wandering", num_steps=0) for orbit in orbits[:2]), *orbits[2:]]
    alike, doubled, *_ = told(loops, walks, unsettled, [None] * 4)
    assert alike.startswith("it repeats itself only every 1 steps; a gait of equal steps that would hold")
    assert doubled.startswith("it repeats itself only every 2 steps")
    assert "a gait of equal steps is there, but deviations from it grow (largest |λ| " in doubled
    assert "of the samples" in alike


def test_an_unstable_gait_is_named_with_its_multiplier(seen):
    loops, walks, orbits, stable = seen
    grown = replace(stable[0], multipliers=(1.25 + 0j, 0.1 + 0j, 0j))
    first, *_ = told(loops, walks, orbits, [grown, *stable[1:]])
    assert first == "the gait is unstable: its largest |λ| is 1.250"
