"""Facts about sines and cosines, for a solver without them."""

from __future__ import annotations

import math
import typing
from collections.abc import Iterator, Sequence
from fractions import Fraction

import z3

from coachable.behaviours.checking.solver.affine import nearest_float

Formula = typing.Any
Real = typing.Any

_BELOW_PI = Fraction(3141592653, 10**9)
_ROUNDING = Fraction(1, 10**14)
"""More than a float's sine is wrong by, and more than an angle of size 1 is."""


def facts_of(angle: Real, sine: Real, cosine: Real) -> Iterator[Formula]:
    """They are on the unit circle, in the right quadrant, and |sin a| < |a|, cos a ≥ 1 − a²/2."""
    pi = z3.RealVal(_BELOW_PI)
    yield sine * sine + cosine * cosine == 1
    for term in (sine, cosine):
        yield from (term >= -1, term <= 1)
    yield z3.Implies(angle == 0, z3.And(sine == 0, cosine == 1))
    yield z3.Implies(z3.And(angle > 0, angle <= pi), z3.And(sine > 0, sine < angle))
    yield z3.Implies(z3.And(angle < 0, angle >= -pi), z3.And(sine < 0, sine > angle))
    yield z3.Implies(_is_flat(angle, pi), z3.And(cosine > 0, 2 * cosine >= 2 - angle * angle))


def order_of(one: Sequence[Real], other: Sequence[Real]) -> Iterator[Formula]:
    """Between −π/2 and π/2 the sine rises; between 0 and π the cosine falls.

    **Arguments:** each an angle, its sine and its cosine.
    """
    pi = z3.RealVal(_BELOW_PI)
    (a, sin_a, cos_a), (b, sin_b, cos_b) = one, other
    flat = z3.And(_is_flat(a, pi), _is_flat(b, pi))
    yield z3.Implies(flat, z3.And((a < b) == (sin_a < sin_b), (b < a) == (sin_b < sin_a)))
    upper = z3.And(a >= 0, b >= 0, a <= pi, b <= pi)
    yield z3.Implies(upper, z3.And((a < b) == (cos_a > cos_b), (b < a) == (cos_b > cos_a)))


def near(angle: Real, known: Fraction, sine: Real, cosine: Real) -> Iterator[Formula]:
    """|sin a − sin a₀| ≤ |a − a₀|, and so for cos: true of every angle a, and exact at the known one, a₀."""
    at, slack = z3.RealVal(known), z3.RealVal(_ROUNDING * (1 + abs(known)))
    distance = z3.If(angle < at, at - angle, angle - at) + slack
    for term, function in ((sine, math.sin), (cosine, math.cos)):
        value = z3.RealVal(Fraction(function(nearest_float(known))))
        yield from (term - value <= distance, value - term <= distance)


def _is_flat(angle: Real, pi: Real) -> Formula:
    return z3.And(2 * angle <= pi, -2 * angle <= pi)
