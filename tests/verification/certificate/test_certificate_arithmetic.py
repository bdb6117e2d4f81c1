"""What the checker computes with holds what it should: exact fractions, mpmath, pyintval, floats."""

from fractions import Fraction
from itertools import pairwise

import ival
import mpmath
import numpy as np
import pyintval
import pytest
from ival import Interval
from scipy.stats import norm

from tests.plants import oracle
from tests.verification.certificate import simulator
from tests.verification.certificate.alone import checker
from tests.verification.certificate.claims import PLANT

RNG = np.random.default_rng(5)
PAPER = checker.Plant(PLANT)
PULL = ival.tan(checker.decimal("-0.07"))
PAD = ((0, 0), (0, 4), (0, 0))


def holds(interval, numbers, slack=0.0):
    return np.all((interval.lo - slack <= numbers) & (numbers <= interval.hi + slack))


def around(centre, radius):
    centre = np.asarray(centre, dtype=float)
    return checker.pair(centre - radius, centre + radius)


def test_a_decimal_number_is_the_number_and_not_its_nearest_float():
    for text in ("9.807", "0.01", "-0.07", "0.1", "123456789.123456789"):
        x = checker.decimal(text)
        assert Fraction(x.lo) < Fraction(text) < Fraction(x.hi) == Fraction(np.nextafter(x.lo, np.inf))
    assert checker.decimal("0.5").lo == checker.decimal("0.5").hi == 0.5


@pytest.mark.parametrize("text", [9.807, "nan", "1e999", "1_0", "", "0x1", None])
def test_what_is_no_decimal_number_is_refused(text):
    with pytest.raises(checker.CertificateError, match="decimal number"):
        checker.decimal(text)


def test_the_mean_of_what_is_clipped_holds_mpmaths_and_is_hardly_wider():
    means, std, low, high = RNG.normal(size=40) * 2, 0.7, -2.0, 0.0
    numbers = (checker.point(np.full(40, number)) for number in (std, low, high))
    ours = checker.clipped_mean(checker.point(means), *numbers)
    below = checker.normal_below(checker.point(means))
    with mpmath.workdps(30):
        for k, mean in enumerate(means):
            inside = mpmath.quad(lambda a, mean=mean: a * mpmath.npdf(a, mean, std), [low, -1.0, high])
            true = inside + low * mpmath.ncdf(low, mean, std) + high * mpmath.ncdf(-high, -mean, std)
            assert ours.lo[k] <= true <= ours.hi[k]
            assert below.lo[k] <= mpmath.ncdf(mean) <= below.hi[k]
    assert np.max(ours.hi - ours.lo) < 1e-13


@pytest.mark.parametrize("name", ["sin", "cos", "tan", "tanh", "exp", "erfc", "sqr"])
def test_functions_agree_with_pyintval_and_hold_mpmaths_values(name):
    x = np.sort(RNG.normal(size=(2, 200)) * 1.4, axis=0)
    ours = getattr(ival, name)(checker.pair(*x))
    with mpmath.workdps(40):
        for lo, hi, our_lo, our_hi in zip(*x, ours.lo, ours.hi, strict=True):
            peer = getattr(pyintval, name)(pyintval.Interval(float(lo), float(hi)))
            assert (our_lo, our_hi) == pytest.approx((peer.lo, peer.hi), rel=1e-15, abs=0)
            for at in (lo, hi, (lo + hi) / 2):
                true = mpmath.mpf(float(at)) ** 2 if name == "sqr" else getattr(mpmath, name)(float(at))
                assert our_lo <= true <= our_hi


def test_sums_and_products_are_rounded_outward():
    a, b = np.sort(RNG.normal(size=(2, 2, 300)), axis=1)
    x, y = checker.pair(*a), checker.pair(*b)
    for ours, exact in (
        (x + y, lambda p, q: p + q),
        (x * y, lambda p, q: p * q),
        (x - y, lambda p, q: p - q),
    ):
        for k in range(300):
            corners = [exact(Fraction(p), Fraction(q)) for p in a[:, k] for q in b[:, k]]
            assert Fraction(ours.lo[k]) <= min(corners) <= max(corners) <= Fraction(ours.hi[k])


def test_dot_holds_the_exact_product_of_members():
    A, x = around(RNG.normal(size=(3, 4, 1)), 0.01), around(RNG.normal(size=(4, 2, 1)), 0.01)
    a, b = (z.lo + RNG.random(z.lo.shape) * (z.hi - z.lo) for z in (A, x))
    ours = checker.dot(A, x)
    for i in range(3):
        for j in range(2):
            true = sum(Fraction(a[i, k, 0]) * Fraction(b[k, j, 0]) for k in range(4))
            assert Fraction(ours.lo[i, j, 0]) <= true <= Fraction(ours.hi[i, j, 0])


def test_an_affine_map_holds_the_exact_one_even_where_floats_cancel():
    W = RNG.normal(size=(5, 64)) * 10.0 ** RNG.integers(-8, 9, size=(5, 64))
    W[:, 32:] = -W[:, :32] * (1 + 2.0**-50)
    b, x = RNG.normal(size=(5, 1)), np.tile(RNG.normal(size=(32, 1)), (2, 1))
    for radius in (0.0, 1e-9):
        box = around(x, radius)
        ours = checker.affine(W, b, box)
        member = box.lo + RNG.random(x.shape) * (box.hi - box.lo)
        for i in range(5):
            true = Fraction(b[i, 0]) + sum(
                Fraction(w) * Fraction(v) for w, v in zip(W[i], member[:, 0], strict=True)
            )
            assert Fraction(ours.lo[i, 0]) <= true <= Fraction(ours.hi[i, 0])


def test_an_inverse_holds_the_exact_one():
    A = RNG.normal(size=(3, 3))
    q = [[Fraction(v) for v in row] for row in A.tolist()]
    det = sum(
        q[0][j] * (q[1][(j + 1) % 3] * q[2][(j + 2) % 3] - q[1][(j + 2) % 3] * q[2][(j + 1) % 3])
        for j in range(3)
    )
    ours = checker.inverse(A[:, :, None], np.linalg.inv(A)[:, :, None])
    for i in range(3):
        for j in range(3):
            a, b, c, d = (j + 1) % 3, (j + 2) % 3, (i + 1) % 3, (i + 2) % 3
            true = (q[a][c] * q[b][d] - q[a][d] * q[b][c]) / det
            assert Fraction(ours.lo[i, j, 0]) <= true <= Fraction(ours.hi[i, j, 0])
            assert ours.hi[i, j, 0] - ours.lo[i, j, 0] < 1e-12


def test_an_inverse_that_is_none_holds_everything():
    assert np.all(checker.inverse(np.eye(3)[:, :, None], np.zeros((3, 3, 1)) + 1.0).hi == np.inf)


def test_sets_hold_their_members():
    z, J0, J = (
        around(RNG.normal(size=(4, 6)), 1e-3),
        around(RNG.normal(size=(4, 3, 6)), 1e-3),
        around(RNG.normal(size=(4, 4, 6)), 1e-3),
    )
    r0, r = around(np.zeros((3, 6)), 0.1), around(np.zeros((4, 6)), 0.01)
    sets = checker.Sets.around(z, J0, r0, J, r)
    for _ in range(50):
        a, b, c, d, e = (w.lo + RNG.random(w.lo.shape) * (w.hi - w.lo) for w in (z, J0, J, r0, r))
        member = a + np.einsum("ikn,kn->in", b, d) + np.einsum("ikn,kn->in", c, e)
        rest = np.linalg.solve(
            np.moveaxis(sets.A, -1, 0), (member - sets.c - np.einsum("ikn,kn->in", sets.C, d)).T[..., None]
        )
        assert holds(sets.r, rest[..., 0].T, 1e-14)
        assert holds(sets.hull, member, 1e-14)


def mp_flow(torque):
    """The equation of motion in mpmath, M inverted by Cramer's rule."""
    hip, m, a, b, g = (mpmath.mpf(PLANT[name]) for name in ("hip_mass", "leg_mass", "a", "b", "gravity"))
    l, sin, cos = a + b, mpmath.sin, mpmath.cos  # noqa: E741

    def flow(_, x):
        one, two, rate_1, rate_2 = x
        w1, w2 = (hip * l + m * (a + l)) * g, m * b * g
        t1, t2 = (
            (
                w1 * cos(one) * mpmath.tan(mpmath.mpf("-0.07")),
                -w2 * cos(two) * mpmath.tan(mpmath.mpf("-0.07")),
            )
            if torque is None
            else torque
        )
        m11, m12, m22 = (hip + m) * l**2 + m * a**2, -m * b * l * cos(one - two), m * b**2
        swirl = m * b * l * sin(one - two)
        first, second = t1 + swirl * rate_2**2 + w1 * sin(one), t2 - swirl * rate_1**2 - w2 * sin(two)
        det = m11 * m22 - m12**2
        return [rate_1, rate_2, (m22 * first - m12 * second) / det, (m11 * second - m12 * first) / det]

    return flow


@pytest.mark.parametrize("torque", [None, (-1.25, 0.5)], ids=["virtual gravity", "held"])
def test_taylor_steps_hold_trajectories_of_many_digits_and_are_hardly_wider(torque):
    state, seventh, nudge = [0.12, -0.05, -0.5, 2.1], mpmath.mpf("0.007"), mpmath.mpf("1e-10")
    with mpmath.workdps(25):
        walks = [
            mpmath.odefun(mp_flow(torque), 0, [mpmath.mpf(v) + e for v, e in zip(state, es, strict=True)])
            for es in ([0] * 4, [0, nudge, 0, 0])
        ]
        (on_the_way, _), (end, moved) = (
            [list(walk(t)) for walk in walks] for t in (seventh, mpmath.mpf("0.01"))
        )
    x = checker.point(np.array(state)[:, None])
    jets = None if torque is None else checker.point(np.pad(np.array(torque)[:, None, None], PAD))
    for order, width in ((3, 1e-3), (6, 1e-9)):
        loop = checker.Loop(PAPER, lambda x, centre: (None, None), PULL, checker.decimal("0.01"), order)
        over, remainder = loop.enclosure(x, jets, Interval(0.0, loop.step.hi))
        series = PAPER.taylor(checker.identity(x), jets, PULL, order)
        ours = checker.at(series[:, :, 0], loop.step) + remainder
        slopes = checker.at(series[:, :, 1:], loop.step)
        for i in range(4):
            assert over.lo[i, 0] <= on_the_way[i] <= over.hi[i, 0]
            assert ours.lo[i, 0] <= end[i] <= ours.hi[i, 0]
            assert abs(slopes.mid[i, 1, 0] - (moved[i] - end[i]) / nudge) < (1e-4 if order == 3 else 1e-8)
        assert np.max(ours.hi - ours.lo) < width


def test_the_impact_holds_the_papers():
    for _ in range(20):
        beta, rates = RNG.uniform(0.1, 0.4), RNG.normal(size=2) - [1.5, 1.5]
        x = np.array([-beta, beta, *rates])
        expected = oracle.impact(x)
        ours = PAPER.impact(checker.identity(checker.point(x[:, None])))
        assert holds(ours[:, 0], expected[[0, 2, 3]][:, None], 1e-13)
        assert np.max(ours.hi[:, 0] - ours.lo[:, 0]) < 1e-12
        nudge = np.array([0, 0, 1e-6, 0])
        nudged = (oracle.impact(x + nudge) - oracle.impact(x - nudge)) / 2e-6
        assert holds(ours[:, 3], nudged[[0, 2, 3]][:, None], 1e-8)


@pytest.fixture
def network():
    sizes = [4, 16, 16, 2]
    return {
        "weights": [RNG.normal(size=(n, k)) / np.sqrt(k) for k, n in pairwise(sizes)],
        "biases": [0.3 * RNG.normal(size=n) for n in sizes[1:]],
        "low": [-0.3, -0.2],
        "high": [0.2, 0.3],
    }


@pytest.mark.parametrize("squashing", ["clip", "tanh", "expected"])
@pytest.mark.parametrize("radius", [0.0, 1e-4, 0.1])
def test_an_interval_network_holds_the_network_and_its_chords(network, squashing, radius):
    layers = tuple((W, b[:, None]) for W, b in zip(network["weights"], network["biases"], strict=True))
    low, high = (np.array(network[end])[:, None] for end in ("low", "high"))
    centre = RNG.normal(size=(4, 50))
    std = np.array([[0.05], [0.4]])
    jets, there = checker.network(
        layers, low, high, std, squashing, around(centre, radius), checker.point(centre)
    )
    if squashing == "clip":
        torque = simulator.network(network)
    else:
        unbounded = simulator.network(network | {"low": [-np.inf] * 2, "high": [np.inf] * 2})

        def torque(x):
            of_joints = unbounded(x)
            u = np.stack([of_joints[0] + of_joints[1], -of_joints[1]])
            if squashing == "tanh":
                u = low + (high - low) * (np.tanh(u) + 1) / 2
            else:
                alpha, beta = (low - u) / std, (high - u) / std
                u = (
                    low * norm.cdf(alpha)
                    + high * norm.sf(beta)
                    + u * (norm.cdf(beta) - norm.cdf(alpha))
                    + std * (norm.pdf(alpha) - norm.pdf(beta))
                )
            return np.stack([u[0] + u[1], -u[1]])

    assert holds(there[:, 0], torque(centre), 1e-13)
    for _ in range(30):
        offset = RNG.uniform(-radius, radius, size=centre.shape)
        value = torque(centre + offset)
        assert holds(jets[:, 0], value, 1e-13)
        chord = checker.dot(jets[:, 1:], checker.point(offset))
        assert holds(chord, value - torque(centre), 1e-12)
    if radius == 0.1 and squashing == "clip":
        assert np.any(torque(centre)[1] == -0.3)


def test_a_network_of_single_floats_becomes_the_same_numbers():
    single = RNG.normal(size=(3, 4)).astype(np.float32)
    assert np.array_equal(checker.floats(single.astype(np.float64).tolist(), 3, 4).astype(np.float32), single)
