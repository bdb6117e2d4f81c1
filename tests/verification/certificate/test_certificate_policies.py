"""Learned policies: where their torques meet the bounds, enclosures still hold every start."""

from pathlib import Path

import numpy as np
import pytest

from coachable.verification.certificate.file import read_certificate
from tests.verification.certificate import simulator
from tests.verification.certificate.alone import checker
from tests.verification.certificate.claims import changed

LEARNED = Path(__file__).parents[3] / "docs" / "results" / "certificates" / "paper-sparse-5.json"
KINK = 4
RNG = np.random.default_rng(8)


def wanted(data, x):
    """The torques u that the network wants, before they are cut."""
    free = {"low": [-np.inf] * 2, "high": [np.inf] * 2}
    of_joints = simulator.network(data["controller"] | free)(x)
    return np.stack([of_joints[0] + of_joints[1], -of_joints[1]])


def at_sample(data, y, k):
    """States at the kth sample after starts y."""
    torque = simulator.network(data["controller"])
    x = np.stack([y[0], -y[0], y[1], y[2]])
    for _ in range(k):
        x = simulator.advance(x, float(data["method"]["step"]), torque(x))
    return x


@pytest.fixture(scope="module")
def clipped():
    """A learned walker whose least hip torque is what it wants at the 4th sample: a kink at its gait."""
    data = read_certificate(LEARNED)
    y = np.array(data["box"]["centre"])
    for _ in range(8):
        least = float(wanted(data, at_sample(data, y[:, None], KINK))[1, 0])
        data = changed(data, "controller", "low", [data["controller"]["low"][0], least])
        y, jacobian = simulator.fixed_point(simulator.network(data["controller"]), True, y)
    box = {"centre": y.tolist(), "basis": simulator.eigenbasis(jacobian).tolist(), "radii": [3e-4] * 3}
    return changed(changed(data, "box", box), "method", "subdivisions", [1, 1, 1])


def test_starts_on_both_sides_of_a_kink_land_where_the_enclosure_says(clipped):
    loop, box, _, numbers, _ = checker.read(clipped)
    (sets,) = box.cut(numbers)
    offsets = RNG.uniform(-1, 1, size=(3, 400)) * np.array(clipped["box"]["radii"])[:, None]
    centre, basis = np.array(clipped["box"]["centre"])[:, None], np.array(clipped["box"]["basis"])
    starts = centre + basis @ offsets
    cut = wanted(clipped, at_sample(clipped, starts, KINK))[1] < clipped["controller"]["low"][1]
    assert 20 < cut.sum() < 380
    after, _ = simulator.stride(starts, simulator.network(clipped["controller"]), True)
    xi = np.linalg.solve(basis, after - centre)
    found = np.zeros(400, bool)
    for (z, J0, _, J, r), _ in loop.stride(sets, box, lambda k: None):
        at = z + checker.dot(J0, checker.point(offsets)) + checker.dot(J, r)
        found |= np.all((at.lo - 1e-11 <= xi) & (xi <= at.hi + 1e-11), axis=0)
    assert found.all()


def test_the_slope_at_a_bound_is_anything_between_flat_and_the_networks(clipped):
    loop, _, _, _, _ = checker.read(clipped)
    x = at_sample(clipped, np.array(clipped["box"]["centre"])[:, None], KINK)
    jets, _ = loop.controller(checker.pair(x - 1e-3, x + 1e-3), checker.point(x))
    inside, _ = loop.controller(checker.point(x), checker.point(x))
    hip = -jets[1, 1:]
    assert np.all(hip.lo <= 0)
    assert np.all(hip.hi >= 0)
    assert np.any(hip.hi - hip.lo > 0.1)
    assert np.max(inside.hi[:, 0] - inside.lo[:, 0]) < 1e-10
