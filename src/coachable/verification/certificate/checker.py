"""Proves a certificate for a compass walker, or says where the proof fails: the one file to read and doubt.

**Claim.** Right after an impact the walker is at θ₁ = β, θ₂ = −β; let y = (β, θ̇₁, θ̇₂). From every start
in B = {centre + basis ξ : |ξⱼ| ≤ radiiⱼ} it touches down `strides` times, its hip never on the ground, and is
in B again, in real arithmetic: so it never falls. All numbers but the decimal strings are exact floats.

**Model.** M(θ) θ̈ + C(θ, θ̇) θ̇ + g(θ) = τ until θ₁ + θ₂ falls through zero while θ₂ > θ₁; then the impact.
τ follows virtual gravity continuously, or is set at every touchdown and every `hold` seconds after it.

**Proof.** B is cut into sub-boxes. Each travels as a set {c + C r₀ + A r}: r₀ ∋ 0 says where in the sub-box
it began, A r, r ∋ 0, holds what is not known so exactly (Lohner 1987). In a step x(t) = T(x, t) + R, with T
the Taylor polynomial, R the remainder over an a-priori enclosure (Moore 1966); T(x, t) is taken as
T(c, t) + DT([x], t) (x − c). Touchdown times come from an interval Newton step. Intervals are rounded
outward by crival's `ival`; matrix products with a network's weights carry a bound of their rounding.

**Trusted.** This file, Python, crival, and that NumPy's float64 sums and products obey IEEE 754 in any order.
Comparisons with an empty interval are false here, so what is undefined proves nothing.
"""

# pyright: reportAttributeAccessIssue=false, reportArgumentType=false, reportIndexIssue=false, reportCallIssue=false
import itertools
import math
import re
import time
from collections.abc import Callable, Iterator, Mapping
from fractions import Fraction
from functools import partial, reduce
from typing import Any, NamedTuple

import ival
import numpy as np
from ival import Interval

SQUASHINGS = ("clip", "tanh", "expected")  # how a network's output is kept within its bounds
BATCH = 1000  # sub-boxes that travel side by side; nothing depends on it but speed


class CertificateError(ValueError):
    """The data is no certificate; the message says what is wrong with it."""


class NotProven(Exception):
    """The proof fails; the message says where."""


class Verdict(NamedTuple):
    """What was claimed, whether it was shown, why (not); how far images reach, over the radii of the box."""

    claim: str
    proven: bool
    reason: str
    reach: tuple[float, ...]
    stride_time: tuple[float, float]  # bounds, from one touchdown to the next [s]
    seconds: float


def require(holds: Any, otherwise: str, error: type[Exception] = NotProven) -> None:
    """Raise an error unless it holds for a whole batch."""
    if not np.all(holds):
        raise error(otherwise)


def pair(lo: np.ndarray, hi: np.ndarray) -> Interval:
    """The intervals with these ends, lo ≤ hi."""
    x = Interval.empty()
    x.lo, x.hi = lo, hi
    return x


def point(x: np.ndarray) -> Interval:
    """Floats as intervals."""
    return pair(x, x)


def stack(*parts: Interval, axis: int = 0) -> Interval:
    """Intervals of one shape along a new axis."""
    return pair(np.stack([x.lo for x in parts], axis), np.stack([x.hi for x in parts], axis))


def join(*parts: Interval, axis: int = 0) -> Interval:
    """Intervals one behind the other along an axis."""
    return pair(np.concatenate([x.lo for x in parts], axis), np.concatenate([x.hi for x in parts], axis))


def total(x: Interval, axis: int = 0) -> Interval:
    """The sum of n along an axis: floats err by at most n u Σ |xᵢ|, u = 2⁻⁵³; 2 n u Σ |xᵢ| is allowed."""
    bound = np.maximum(np.abs(x.lo), np.abs(x.hi)).sum(axis) * (x.lo.shape[axis] * 2.0**-52)
    return pair(x.lo.sum(axis) - bound, x.hi.sum(axis) + bound)


def dot(A: Interval, x: Interval) -> Interval:
    """A x, with A (m, k, batch) and x vectors (k, batch) or matrices (k, n, batch)."""
    return total((A if x.lo.ndim == 2 else A[:, :, None]) * x[None], axis=1)


def inverse(A: np.ndarray, R: np.ndarray) -> Interval:
    """A⁻¹ = (I − E)⁻¹ R, E = I − R A (n, n, batch), where |((I − E)⁻¹ − I)ᵢⱼ| ≤ ‖E‖ / (1 − ‖E‖)."""
    E = point(np.eye(len(A))[:, :, None]) - dot(point(R), point(A))
    norm = point(total(point(E.mag), axis=1).hi.max(axis=0))
    eta = np.where(norm.hi < 0.5, (norm / (1.0 - norm)).hi, math.inf)
    return point(R) + pair(-eta, eta) * total(point(np.abs(R)))[None]


# A *jet* is an array (1 + n, batch): a value, then its derivatives in n directions, none where n is 0.
# A *series* is an array (order + 1, …) of values or jets: Taylor coefficients in time.


def times(a: Interval, b: Interval) -> Interval:
    """Σ aⱼ bⱼ over the leading axis, of jets."""
    sums = total(a[:, :1] * b)
    if a.lo.shape[1] == 1:
        return sums
    return join(sums[:1], sums[1:] + total(a[:, 1:] * b[:, :1]))


def product(a: list[Interval], b: list[Interval], k: int) -> Interval:
    """Coefficient k of the product of two series of jets."""
    return times(stack(*a[: k + 1]), stack(*b[k::-1]))


def divided(a: Interval, b: Interval) -> Interval:
    """The jet of a / b."""
    value = a[:1] / b[:1]
    return join(value, (a[1:] - value * b[1:]) / b[:1])


def sin_cos(x: Interval) -> tuple[Interval, Interval]:
    """The jets of sin x and cos x."""
    sin, cos = ival.sin(x[:1]), ival.cos(x[:1])
    return join(sin, cos * x[1:]), join(cos, -(sin * x[1:]))


def identity(x: Interval) -> Interval:
    """Values (n, batch) as jets (n, 1 + n, batch) with derivatives with respect to themselves."""
    return join(x[:, None], point(np.repeat(np.eye(len(x))[:, :, None], x.lo.shape[1], 2)), axis=1)


def at(series: Interval, t: Interval) -> Interval:
    """The polynomial with these coefficients at times t."""
    return reduce(lambda value, k: value * t + series[k], reversed(range(len(series) - 1)), series[-1])


def speed(series: Interval, t: Interval) -> Interval:
    """The polynomial's derivative at times t."""
    return at(series[1:] * point(np.arange(1.0, len(series)).reshape(-1, *[1] * (series.lo.ndim - 1))), t)


def values(part: Mapping[str, Any], *names: str) -> list:
    """What a part says under these names; what is under any other would be claimed, and not proven."""
    require(set(part) == set(names), f"expected {', '.join(names)}; got {', '.join(part)}", CertificateError)
    return [part[name] for name in names]


def decimal(text: Any, above: float = -math.inf) -> Interval:
    """The tightest interval around a decimal number above a bound; 9.807 is not a float."""
    fits = isinstance(text, str) and re.fullmatch(r"-?[0-9]{1,30}(\.[0-9]{1,30})?", text)
    require(fits, f"{text!r:.99} should be a decimal number in quotation marks", CertificateError)
    require(Fraction(text) > above, f"{text!r} should be above {above}", CertificateError)
    return Interval(Fraction(text))


class Plant:
    """The walker's constants, as intervals around what the decimal numbers say."""

    def __init__(self, data: Mapping[str, str]):
        constants = values(data, "hip_mass", "leg_mass", "a", "b", "gravity")
        hip, m, a, b, g = (decimal(text, above=0.0) for text in constants)
        self.a, self.b, self.leg, self.lever = a, b, a + b, (a + b) / b
        self.stance_inertia = (hip + m) * self.leg * self.leg + m * a * a
        self.free_inertia, self.swing_inertia = m * self.leg * self.leg, m * b * b
        self.coupling, self.impact_coupling = m * b * self.leg, m * a * b
        self.hip_moment = (hip * self.leg + m * a) * self.leg
        self.stance_weight, self.swing_weight = (hip * self.leg + m * (a + self.leg)) * g, m * b * g

    def inertia(self, cos_squared: Interval) -> Interval:
        """The jet det M / (m b²) = I − m l² cos² δ, I the stance leg's inertia."""
        one = point(np.eye(len(cos_squared), 1))
        return self.stance_inertia * one - self.free_inertia * cos_squared

    def virtual_gravity(self, pull: Interval, x: Interval, centre: Interval) -> tuple[Interval, Interval]:
        """τ = (w₁ cos θ₁, −w₂ cos θ₂) · pull as of `Loop.controller`."""
        weights, z = (self.stance_weight * pull, -(self.swing_weight * pull)), identity(x)
        over = stack(*(w * sin_cos(z[i])[1] for i, w in enumerate(weights)))
        return over, stack(*(w * ival.cos(centre[i : i + 1]) for i, w in enumerate(weights)))

    def taylor(self, x: Interval, torque: Interval | None, pull: Interval, order: int) -> Interval:
        """Taylor coefficients (order + 1, 4, 1 + n, batch) of the solution through jets x (4, 1 + n, batch).

        With δ = θ₁ − θ₂ and s = τ₂ − m b l sin δ θ̇₁² − w₂ sin θ₂ the equation of motion is
        θ̈₁ = (τ₁ + m b l sin δ θ̇₂² + w₁ sin θ₁ + (l / b) cos δ s) / (I − m l² cos² δ),
        θ̈₂ = s / (m b²) + (l / b) cos δ θ̈₁. τ is held, jets, or it is (w₁ cos θ₁, −w₂ cos θ₂) · pull.
        """
        *_, rate_1, rate_2 = states = [[x[i]] for i in range(4)]
        angles = (x[0] - x[1], x[0], x[1])
        (sin, cos), (sin_1, cos_1), (sin_2, cos_2) = ([[part] for part in sin_cos(a)] for a in angles)
        spread, square_1, square_2, push, inertia, lift = ([] for _ in range(6))
        trigs = (sin, cos, spread), (sin_1, cos_1, rate_1), (sin_2, cos_2, rate_2)
        for k in range(order):
            for s, c, rate in trigs if k else ():
                s.append(product(rate, c, k - 1) / float(k))
                c.append(-product(rate, s, k - 1) / float(k))
            spread.append(rate_1[k] - rate_2[k])
            square_1.append(product(rate_1, rate_1, k))
            square_2.append(product(rate_2, rate_2, k))
            moment = self.coupling * product(sin, square_2, k) + self.stance_weight * sin_1[k]
            swing = -(self.coupling * product(sin, square_1, k)) - self.swing_weight * sin_2[k]
            if torque is None:
                moment += self.stance_weight * pull * cos_1[k]
                swing -= self.swing_weight * pull * cos_2[k]
            elif k == 0:
                moment, swing = moment + torque[0], swing + torque[1]
            push.append(swing)
            moment += self.lever * product(cos, push, k)
            cos_squared = product(cos, cos, k)
            inertia.append(-(self.free_inertia * cos_squared) if k else self.inertia(cos_squared))
            if k:
                moment -= times(stack(*lift), stack(*inertia[k:0:-1]))
            lift.append(divided(moment, inertia[0]))
            swing = swing / self.swing_inertia + self.lever * product(cos, lift, k)
            for state, rate in zip(states, (rate_1[k], rate_2[k], lift[k], swing), strict=True):
                state.append(rate / float(k + 1))
        return stack(*(stack(*state) for state in states), axis=1)

    def impact(self, x: Interval) -> Interval:
        """Jets of y (3, 1 + n, batch) right after a touchdown at jets x; momenta are conserved."""
        cos, rate_1, rate_2 = sin_cos(x[0] - x[1])[1], x[2], x[3]
        momentum = self.hip_moment * times(cos[None], rate_1[None]) - self.impact_coupling * rate_2
        stance = divided(momentum, self.inertia(times(cos[None], cos[None])))
        swing = (self.leg * times(cos[None], stance[None]) - self.a * rate_1) / self.b
        return stack((x[1] - x[0]) / 2.0, stance, swing)


def normal_below(z: Interval) -> Interval:
    """Φ(z), the standard normal distribution."""
    return ival.erfc(-z / ival.sqrt(Interval(2.0))) / 2.0


def clipped_mean(mean: Interval, std: Interval, low: Interval, high: Interval) -> Interval:
    """E[clip(N(mean, std²), low, high)], which rises with the mean: by its ends.

    It is low + std (h(a) − h(b)), h(z) = z Φ(z) + φ(z), a = (mean − low) / std, b = (mean − high) / std.
    """
    peak = 1.0 / ival.sqrt(2.0 * ival.acos(Interval(-1.0)))

    def excess(z: Interval) -> Interval:
        return z * normal_below(z) + peak * ival.exp(-ival.sqr(z) / 2.0)

    ends = [
        low + std * (excess((end - low) / std) - excess((end - high) / std))
        for end in (point(mean.lo), point(mean.hi))
    ]
    return pair(ends[0].lo, ends[1].hi)


def network(
    layers: Any, low: np.ndarray, high: np.ndarray, std: Any, squashing: str, x: Interval, centre: Interval
):
    """τ = (u₁ + u₂, −u₂), u = squash(W_n tanh(… tanh(W_1 x + b_1) …) + b_n), as of `Loop.controller`.

    Where a clipped u may be at a bound in a part of x, its slope is anything between 0 and the network's.
    `expected` is the mean of what is clipped, of a normal distribution about the network's output.
    """
    over, slopes = output(layers, x)
    there, _ = output(layers, centre)
    over = over & (there + dot(slopes, x - centre))
    if squashing == "clip":
        inside, beyond = (over.lo >= low) & (over.hi <= high), (over.hi <= low) | (over.lo >= high)
        factor = pair(np.where(inside & ~beyond, 1.0, 0.0), np.where(beyond, 0.0, 1.0))
        u, u_there = (pair(*np.clip((v.lo, v.hi), low, high)) for v in (over, there))
    elif squashing == "expected":
        sigma, least, greatest = point(std), point(low), point(high)
        factor = normal_below((over - least) / sigma) - normal_below((over - greatest) / sigma)
        u, u_there = (clipped_mean(v, sigma, least, greatest) for v in (over, there))
    else:
        half = (point(high) - point(low)) / 2.0
        factor = half * (1.0 - ival.sqr(ival.tanh(over)))
        u, u_there = (point(low) + half * (ival.tanh(v) + 1.0) for v in (over, there))
    u, u_there = join(u[:, None], factor[:, None] * slopes, axis=1), u_there[:, None]
    return stack(u[0] + u[1], -u[1]), stack(u_there[0] + u_there[1], -u_there[1])


def output(layers: Any, x: Interval) -> tuple[Interval, Interval]:
    """The last layer's output (2, batch) and its derivative (2, 4, batch) over x."""
    *hidden, (weight, bias) = layers
    derivatives = []
    for W, b in hidden:
        x = ival.tanh(affine(W, b, x))
        derivatives.append(1.0 - ival.sqr(x))
    slopes = [point(row[:, None]) for row in weight]
    for (W, _), derivative in zip(reversed(hidden), reversed(derivatives), strict=True):
        slopes = [affine(W.T, np.zeros((W.shape[1], 1)), row * derivative) for row in slopes]
    return affine(weight, bias, x), stack(*slopes)


def affine(W: np.ndarray, b: np.ndarray, x: Interval) -> Interval:
    """W x + b for x (k, batch) and b (m, 1), by midpoint and radius.

    Floats summed in any order err by at most (k + 2) u (|W| |mid| + |b|), u = 2⁻⁵³ (Higham, *Accuracy and
    Stability of Numerical Algorithms*, 3.1). `slack` is more than twice that, for the bound's own rounding;
    1e-290 is above all that underflow can hide.
    """
    middle, slack = (x.lo + x.hi) / 2, (W.shape[1] + 4) * 2.0**-52
    size = np.abs(W) @ np.abs(middle) + np.abs(b)
    radius = (np.abs(W) @ (x - point(middle)).mag + slack * size) * (1 + slack) + 1e-290
    return point(W @ middle + b) + pair(-radius, radius)


class Sets(NamedTuple):
    """Sets {c + C r₀ + A r}: c (4, batch), C (4, 3, batch), r₀ (3, batch), A (4, 4, batch), r (4, batch)."""

    c: np.ndarray
    C: np.ndarray
    r0: Interval
    A: np.ndarray
    r: Interval

    @property
    def hull(self) -> Interval:
        """Intervals around them (4, batch)."""
        return point(self.c) + dot(point(self.C), self.r0) + dot(point(self.A), self.r)

    @staticmethod
    def around(z: Interval, J0: Interval, r0: Interval, J: Interval, r: Interval) -> "Sets":
        """Sets that hold all z + J₀ r₀ + J r; A is orthogonal, from J's columns, longer ones first."""
        c, C = z.mid, J0.mid
        columns = np.moveaxis(J.mid * (r.mag + 1e-300), -1, 0)
        order = np.argsort(-np.linalg.norm(columns, axis=1), axis=1)
        A = np.moveaxis(np.linalg.qr(np.take_along_axis(columns, order[:, None, :], axis=2))[0], 0, -1)
        left_over = z - point(c) + dot(J0 - point(C), r0)
        to_A = inverse(A, A.swapaxes(0, 1))
        return Sets(c, C, r0, A, dot(dot(to_A, J), r) + dot(to_A, left_over))


class Box:
    """B = {centre + basis ξ : |ξⱼ| ≤ radiiⱼ} on the section y = (β, θ̇₁, θ̇₂)."""

    def __init__(self, centre: np.ndarray, basis: np.ndarray, radii: np.ndarray):
        up, sign = [0, 0, 1, 2], np.array([[1.0], [-1.0], [1.0], [1.0]])  # θ₁ = β, θ₂ = −β
        self.centre, self.radii, self.state = point(centre), point(radii), point(centre[up] * sign)
        self.lift = point((basis[up] * sign)[:, :, None])
        self.coordinates = inverse(basis[:, :, None], np.linalg.inv(basis)[:, :, None])

    def sets(self, z: Interval, J0: Interval, r0: Interval, J: Interval, r: Interval) -> Sets:
        """The states right after an impact at ξ = z + J₀ r₀ + J r."""
        return Sets.around(self.state + dot(self.lift, z), dot(self.lift, J0), r0, dot(self.lift, J), r)

    def cut(self, numbers: tuple[int, ...]) -> Iterator[Sets]:
        """All sub-boxes in batches. Neighbours share their edges, floats, so that together they are B."""
        sides = []
        for radius, number in zip(self.radii.lo[:, 0], numbers, strict=True):
            edges = np.concatenate([[-radius], np.linspace(-radius, radius, number + 1)[1:-1], [radius]])
            require(np.diff(edges) > 0, "the box is too small to be cut so often")
            sides.append(list(itertools.pairwise(edges)))
        every = itertools.product(*sides)
        while batch := list(itertools.islice(every, BATCH)):
            low, high = np.moveaxis(np.array(batch), 0, -1).swapaxes(0, 1)
            middle, one = (low + high) / 2, np.repeat(np.eye(3)[:, :, None], len(batch), 2)
            J, r = np.zeros((3, 4, len(batch))), np.zeros((4, len(batch)))
            yield self.sets(point(middle), point(one), pair(low, high) - point(middle), point(J), point(r))


class Loop(NamedTuple):
    """The walker and how it is driven.

    `controller` sets the torque at each step's start: from sets' hulls x and centres c (4, batch) it gives
    jets of τ over x (2, 5, batch), slopes K such that τ(x) − τ(c) = K (x − c), and τ(c) (2, 1, batch); or
    None, where τ follows virtual gravity of this pull continuously. `step` is a time step's length [s].
    """

    plant: Plant
    controller: Callable[[Interval, Interval], tuple[Interval | None, Interval | None]]
    pull: Interval
    step: Interval
    order: int

    def enclosure(self, x: Interval, torque: Interval | None, t: Interval) -> tuple[Interval, Interval]:
        """B ⊃ x + t f(B), where solutions from x stay during t ∋ 0 (Picard, Lindelöf); their remainder."""
        torque = None if torque is None else torque[:, :1]
        over, inside = x, np.array(False)
        for _ in range(12):
            width = 0.1 * (over.hi - over.lo) + 1e-12
            guess = pair(over.lo - width, over.hi + width)
            over = x + t * self.plant.taylor(guess[:, None], torque, self.pull, 1)[1, :, 0]
            inside = (over.lo >= guess.lo) & (over.hi <= guess.hi) & np.isfinite(over.hi - over.lo)
            if inside.all():
                break
        require(inside, "no a-priori enclosure was found")
        require(np.abs((over.lo[:2], over.hi[:2])) < 1.57, "a leg may be level, or the hip on the ground")
        last = self.plant.taylor(over[:, None], torque, self.pull, self.order + 1)[-1, :, 0]
        return over, last * ival.pown(t, self.order + 1)

    def land(self, box: Box, sets: Sets, x: Interval, torque: Any, series: Interval, there: Interval):
        """Carry sets through their touchdown, from the start of the step in which it may be.

        Returns (z, J₀, r₀, J, r), ξ = z + J₀ r₀ + J r right after the impact, and when that is in the step.
        Solutions under its torque are followed for half a step before it and behind it, too: where touchdown
        may come before or after a sample, both are looked at, each as if it were so.

        With σ̂(x, ρ) the time at which g = θ₁ + θ₂ of the polynomial T is ρ, touchdown is at T(x, σ̂) + R with
        ρ = −g(R); in mean-value form around (c, g(T(c, σ))) its slopes are (I − Ṫ ∇g / ġ) DT and Ṫ / ġ.
        """
        window = (-self.step / 2.0) | (self.step * 1.5)
        over, remainder = self.enclosure(x, torque, window)
        down = (over[1] - over[0]).lo > 0, (over[2] + over[3]).hi < 0
        require(down, "the swing foot may be behind, or not come down, around its touchdown")
        values, there = series[:, :, 0], there[:, :, 0]
        guard, guard_there = values[:, 0] + values[:, 1], there[:, 0] + there[:, 1]
        touch = point(np.full(x.lo.shape[1], self.step.lo / 2))
        for _ in range(8):
            newton = touch - at(guard_there, touch) / speed(guard_there, touch)
            touch = point(np.clip(newton.mid, window.lo, window.hi))
        level = at(guard_there, touch)
        levels = level | -(remainder[0] + remainder[1])
        when = pair(np.full_like(touch.lo, window.lo), np.full_like(touch.lo, window.hi))
        for _ in range(3):
            falling = speed(guard, when)
            newton = point(when.mid) - (at(guard, point(when.mid)) - levels) / falling
            inside = (newton.lo > window.lo) & (newton.hi < window.hi) & (falling.hi < 0)
            require(inside, "the time of the touchdown could not be enclosed")
            when = newton & when
        velocity, flow = speed(values, when), at(series[:, :, 1:], when)
        ray = velocity / (velocity[0] + velocity[1])
        slopes = [dot(flow, point(part)) for part in (sets.C, sets.A)]
        J0, J = (slope - ray[:, None] * (slope[0] + slope[1])[None] for slope in slopes)
        base, rest = at(there, touch), ray * (levels - level) + remainder
        hull = base | (base + dot(J0, sets.r0) + dot(J, sets.r) + rest)
        to_box = dot(box.coordinates, self.plant.impact(identity(hull))[:, 1:])
        y = self.plant.impact(base[:, None])[:, 0]
        z = dot(box.coordinates, y - box.centre) + dot(to_box, rest)
        return (z, dot(to_box, J0), sets.r0, dot(to_box, J), sets.r), when

    def stride(self, sets: Sets, box: Box, tick: Callable[[int], None]) -> list[tuple[tuple, Interval]]:
        """Carry sets from right after one touchdown to right after the next; see `land`.

        There is no touchdown in a step in which the swing leg stays behind, or g = θ₁ + θ₂ rises throughout,
        or keeps its sign, or falls throughout and is still positive at the end.
        """
        landings, arriving = [], np.zeros(sets.c.shape[1], bool)
        x = sets.hull
        for k in range(300):
            tick(k)
            torque, torque_there = self.controller(x, centre := point(sets.c))
            over, remainder = self.enclosure(x, torque, Interval(0.0, self.step.hi))
            series = self.plant.taylor(identity(x), torque, self.pull, self.order)
            there = self.plant.taylor(centre[:, None], torque_there, self.pull, self.order)
            flow, end = at(series[:, :, 1:], self.step), at(there[:, :, 0], self.step) + remainder
            after = Sets.around(end, dot(flow, point(sets.C)), sets.r0, dot(flow, point(sets.A)), sets.r)
            lead, guard, falling = over[1] - over[0], over[0] + over[1], over[2] + over[3]
            x_after = after.hull
            nothing = (lead.hi < 0) | (falling.lo > 0) | (guard.lo > 0) | (guard.hi < 0)
            nothing |= (falling.hi < 0) & ((x_after[0] + x_after[1]).lo > 0)
            lands = np.flatnonzero(~nothing | arriving)
            goes_on = np.ones(len(arriving), bool)
            if len(lands):
                require(k > 0, "a touchdown may follow another within one sample")
                above = ((x[0] + x[1]).lo > 0) | arriving
                require(above[lands], f"the swing foot may be down early, at sample {k}")
                parts = [part if part is None else part[..., lands] for part in (x, torque, series, there)]
                image, when = self.land(box, Sets(*(part[..., lands] for part in sets)), *parts)
                landings.append((image, when + self.step * float(k)))
                arriving[lands], goes_on[lands] = True, ~(when.hi <= self.step.lo)
            sets = Sets(*(part[..., goes_on] for part in after))
            arriving, x = arriving[goes_on], x_after[..., goes_on]
            if not len(arriving):
                return landings
        raise NotProven("there may be no touchdown within 300 steps")


@np.errstate(all="ignore")
def check(certificate: Mapping[str, Any], progress: Callable[[float], None] = lambda done: None) -> Verdict:
    """Prove the claim of a certificate, or say where the proof fails.

    `progress` is described the fraction done. Raises `CertificateError` for data that is no certificate.
    """
    began, reach, quickest, slowest, done = time.monotonic(), np.zeros(3), math.inf, 0.0, 0.0
    loop, box, strides, numbers, claim = read(certificate)
    try:
        require(np.nextafter(0.0, 1.0) != 0, "this thread takes subnormal numbers for 0, unlike IEEE 754")
        for sub_boxes in box.cut(numbers):
            sets, share = [sub_boxes], sub_boxes.c.shape[1] / math.prod(numbers) / strides
            for turn in range(1, strides + 1):
                tick = partial(lambda begun, share, k: progress(begun + share * min(k / 100, 1)), done, share)
                landings = [landing for part in sets for landing in loop.stride(part, box, tick)]
                for (z, J0, r0, J, r), when in landings:
                    quickest, slowest = min(quickest, when.lo.min()), max(slowest, when.hi.max())
                    if turn == strides:
                        xi = z + dot(J0, r0) + dot(J, r)
                        reach = np.maximum(reach, (point(xi.mag) / box.radii).hi.max(axis=1))
                sets = [box.sets(*image) for image, _ in landings]
                done += share
        require(reach <= 1, f"images of the box may reach {np.max(reach):.3f} of its radius")
        reason, proven = f"proven: images of the box reach {np.max(reach):.3f} of its radius at most", True
    except NotProven as failure:
        reason, proven = f"not a proof: {failure}", False
    times_taken, seconds = (float(quickest), float(slowest)), time.monotonic() - began
    return Verdict(claim, proven, reason, tuple(reach.tolist()), times_taken, seconds)


def read(data: Mapping[str, Any]) -> tuple[Loop, Box, int, tuple[int, ...], str]:
    """What a certificate says: loop, box, strides, how often the box is cut along each axis; the claim."""
    try:
        plant, given, strides = Plant(data["plant"]), dict(data["controller"]), data["strides"]
        centre, basis, radii = values(data["box"], "centre", "basis", "radii")
        length, order, numbers = values(data["method"], "step", "order", "subdivisions")
        step, numbers, pull = decimal(length, above=0.0), tuple(numbers), Interval(0.0)
        whole = [type(n) is int and 0 < n <= 1000 for n in (order, strides, *numbers)] + [len(numbers) == 3]
        require(whole, "order, strides, 3 subdivisions should be whole numbers from 1 to 1000", ValueError)
        if (kind := given.pop("kind")) == "virtual-gravity":
            hold, slope = values(given, "hold", "slope")
            require(decimal(slope, -1.57).hi < 1.57, "a slope should be below 1.57 rad", ValueError)
            pull, described = ival.tan(decimal(slope, -1.57)), f"virtual gravity of slope {slope} rad"
            controller = partial(plant.virtual_gravity, pull) if hold else lambda x, centre: (None, None)
        elif kind == "network" and given.get("squashing") in SQUASHINGS and given.get("hold"):
            names = ("hold", "squashing", "low", "high", "weights", "biases")
            sigma = [given.pop("std")] if given["squashing"] == "expected" else []
            hold, squashing, *bounds, weights, biases = values(given, *names)
            sizes = itertools.pairwise([4, *(len(bias) for bias in biases[:-1]), 2])
            layers = zip(weights, biases, sizes, strict=True)
            layers = tuple((floats(W, n, k), floats(bias, n, 1)) for W, bias, (k, n) in layers)
            low, high = (floats(bound, 2, 1) for bound in bounds)
            require(low <= high, "a torque's low should not be above its high", ValueError)
            std = [floats(each, 2, 1) for each in sigma]
            require([each > 0 for each in std], "std should be above 0", ValueError)
            controller = partial(network, layers, low, high, *(std or [None]), squashing)
            described = f"this tanh network, its output in {bounds[0]} to {bounds[1]} ({squashing})"
            described += f", of normal torques of std {sigma[0]} about it" if std else ""
        else:
            raise ValueError("the controller should be virtual gravity, or a network that is held")
        require(hold in (None, length), "a time step should be as long as a torque is held", ValueError)
        where = Box(floats(centre, 3, 1), floats(basis, 3, 3), floats(radii, 3, 1))
    except (LookupError, TypeError, ValueError, ArithmeticError, RuntimeError) as error:
        raise CertificateError(f"this is no certificate: {type(error).__name__}: {error}") from None
    described += f", set at touchdown and every {hold} s after it" if hold else ", continuous"
    claim = (
        f"Right after an impact anywhere in the box around (β, θ̇1, θ̇2) = {centre} with radii "
        f"{radii} along the columns of {basis}, the compass walker (SI units: {data['plant']}) "
        f"under {described}, touches down {strides} time(s) upright and is in the box again: it never falls."
    )
    return Loop(plant, controller, pull, step, order), where, strides, numbers, claim


def floats(numbers: Any, *shape: int) -> np.ndarray:
    """Numbers as an array of this shape, exactly; no text, no truth values, no integers between floats."""
    array = np.array(numbers, dtype=object)
    plain = all(isinstance(x, int | float) and type(x) is not bool for x in array.flat)
    whole = [plain and (isinstance(x, float) or abs(x) < 2**1024) for x in array.flat]
    exact = [fits and math.isfinite(x) and float(x) == x for fits, x in zip(whole, array.flat, strict=True)]
    require(all(exact) and array.shape in (shape, shape[:1]), f"expected floats of shape {shape}", ValueError)
    return array.astype(np.float64).reshape(shape)
