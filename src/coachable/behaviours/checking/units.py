"""Units such as `rad/s` and `N*m`: their base units, and whether two are the same.

A description is never converted; a column of a recording is, where the factor is exact. A word that is not
known is a unit of its own, equal only to itself.
"""

from __future__ import annotations

import math
import re
from collections.abc import Mapping
from dataclasses import dataclass
from difflib import get_close_matches
from fractions import Fraction
from types import MappingProxyType

from coachable.foundation.errors import BehaviourError

_KNOWN: Mapping[str, tuple[float | Fraction, Mapping[str, int]]] = MappingProxyType(
    {
        "1": (Fraction(1), {}),
        "%": (Fraction(1, 100), {}),
        "rad": (Fraction(1), {"rad": 1}),
        "deg": (math.pi / 180, {"rad": 1}),
        "°": (math.pi / 180, {"rad": 1}),
        "rev": (2 * math.pi, {"rad": 1}),
        "m": (Fraction(1), {"m": 1}),
        "km": (Fraction(1000), {"m": 1}),
        "cm": (Fraction(1, 100), {"m": 1}),
        "mm": (Fraction(1, 1000), {"m": 1}),
        "s": (Fraction(1), {"s": 1}),
        "ms": (Fraction(1, 1000), {"s": 1}),
        "us": (Fraction(1, 10**6), {"s": 1}),
        "µs": (Fraction(1, 10**6), {"s": 1}),
        "ns": (Fraction(1, 10**9), {"s": 1}),
        "min": (Fraction(60), {"s": 1}),
        "h": (Fraction(3600), {"s": 1}),
        "Hz": (Fraction(1), {"s": -1}),
        "kg": (Fraction(1), {"kg": 1}),
        "g": (Fraction(1, 1000), {"kg": 1}),
        "A": (Fraction(1), {"A": 1}),
        "K": (Fraction(1), {"K": 1}),
        "N": (Fraction(1), {"kg": 1, "m": 1, "s": -2}),
        "kN": (Fraction(1000), {"kg": 1, "m": 1, "s": -2}),
        "mN": (Fraction(1, 1000), {"kg": 1, "m": 1, "s": -2}),
        "Nm": (Fraction(1), {"kg": 1, "m": 2, "s": -2}),
        "J": (Fraction(1), {"kg": 1, "m": 2, "s": -2}),
        "W": (Fraction(1), {"kg": 1, "m": 2, "s": -3}),
        "Pa": (Fraction(1), {"kg": 1, "m": -1, "s": -2}),
        "V": (Fraction(1), {"kg": 1, "m": 2, "s": -3, "A": -1}),
    }
)
_OTHER_WORDS: Mapping[str, str] = MappingProxyType(
    {
        word: unit
        for unit, words in {
            "rad": ("radian", "radians"),
            "deg": ("degree", "degrees"),
            "m": ("meter", "meters", "metre", "metres"),
            "s": ("sec", "secs", "second", "seconds"),
            "N": ("newton", "newtons"),
            "µs": ("μs",),  # the Greek letter in place of the sign for micro
        }.items()
        for word in words
    }
)
_WITH_POWER = re.compile(r"(\D+?)([+-]?\d{1,3})")
"""As in `m/s2` and `m s-2`, of a known word: others may end in digits."""
_FACTOR = re.compile(r"([^\s*·/^\d()][^\s*·/^()]*|1)(?:(?:\^|\*\*)([+-]?\d{1,3}))?")
_SUPERSCRIPT = re.compile("[⁺⁻]?[⁰¹²³⁴-⁹]+")
_PLAIN = str.maketrans("⁺⁻⁰¹²³⁴⁵⁶⁷⁸⁹", "+-0123456789")
_JOINED = re.compile(r"(?<=[^\W\d])[.\-](?=[^\W\d])")
_BETWEEN = re.compile(r"\s*(?:[*·/](?!\*)|\s)\s*")


@dataclass(frozen=True)
class Unit:
    """`scale` times a product of powers of base units; `powers` are sorted and hold no zeros.

    The scale is a fraction where it is exact, and a float where π is in it.
    """

    scale: float | Fraction = Fraction(1)
    powers: tuple[tuple[str, int], ...] = ()

    def times(self, other: Unit, power: int = 1) -> Unit:
        """The unit of a product; with `power=-1` of a quotient."""
        powers = dict(self.powers)
        for base, exponent in other.powers:
            powers[base] = powers.get(base, 0) + power * exponent
        left = tuple(sorted((base, exponent) for base, exponent in powers.items() if exponent))
        try:
            scale = self.scale * other.scale**power
            return Unit(scale if float(scale) else 0.0, left)
        except (OverflowError, ZeroDivisionError):
            return Unit(math.inf, left)

    def same_dimension(self, other: Unit) -> bool:
        """Whether a number in one unit could be converted to the other."""
        return self.powers == other.powers

    def equals(self, other: Unit) -> bool:
        """Whether numbers in the two units may be compared as they are.

        A radian is a number: metres are the same as metres times radians, so an arc is a length. Degrees
        are not, for their scale is another.
        """
        return self._without_angle() == other._without_angle() and math.isclose(
            self.scale, other.scale, rel_tol=1e-9
        )

    def _without_angle(self) -> tuple[tuple[str, int], ...]:
        return tuple((base, exponent) for base, exponent in self.powers if base != "rad")

    def __str__(self) -> str:
        over = [_power(base, exponent) for base, exponent in self.powers if exponent > 0]
        under = [_power(base, -exponent) for base, exponent in self.powers if exponent < 0]
        text = "/".join(["*".join(over) or "1", *under]) if self.powers else "no unit"
        return (
            text
            if math.isclose(self.scale, 1.0)
            else f"{float(self.scale):.4g} {text}".replace(" no unit", "")
        )


NONE = Unit()
"""The unit of a pure number."""

SECOND = Unit(Fraction(1), (("s", 1),))


def _power(base: str, exponent: int) -> str:
    return base if exponent == 1 else f"{base}^{exponent}"


def parse_unit(text: str) -> Unit:
    """The unit that a text such as `rad/s`, `m/s^2`, `N*m`, `1/s` or `%` names; of no text, `NONE`.

    Factors are joined by `*`, `·`, `.`, `-`, a space or `/`, and `/` divides by the one factor behind it.
    Powers are written `s^2`, `s**2`, `s²` or, of a word that is known, `s2`.

    **Raises:** `BehaviourError` for what cannot be read so.
    """
    unit, position, divide = NONE, 0, False
    text = _SUPERSCRIPT.sub(lambda digits: "^" + digits[0].translate(_PLAIN), text.strip())
    text = _JOINED.sub("*", text)
    while position < len(text):
        factor = _FACTOR.match(text, position)
        if factor is None:
            raise BehaviourError(f"unit {text!r}: {text[position:]!r} is not a unit; write such as 'm/s^2'")
        word, digits = _word_and_power(factor)
        scale, powers = _KNOWN.get(word, (Fraction(1), {word: 1}))
        power = int(digits or 1)
        unit = unit.times(_raised(Unit(scale, tuple(sorted(powers.items()))), power), -1 if divide else 1)
        position = factor.end()
        if position < len(text):
            between = _BETWEEN.match(text, position)
            if between is None or between.end() == len(text):
                raise BehaviourError(f"unit {text!r}: it ends in {text[position:]!r}; write such as 'm/s^2'")
            divide = "/" in between[0]
            position = between.end()
    return unit


def _word_and_power(factor: re.Match[str]) -> tuple[str, str | None]:
    """A factor's word, by its usual name, and the power that it has."""
    word, power = _OTHER_WORDS.get(factor[1], factor[1]), factor[2]
    if word not in _KNOWN and power is None and (split := _WITH_POWER.fullmatch(word)):
        base = _OTHER_WORDS.get(split[1], split[1])
        if base in _KNOWN:
            return base, split[2]
    return word, power


def exact_factor(unit: str, wanted: str) -> Fraction | None:
    """What numbers in a unit are multiplied by for another; `None` if it is not exact or there is none.

    An angle is a unit here, not a number: a frequency in Hz and one in rad/s are not the same.
    """
    try:
        one, other = parse_unit(unit), parse_unit(wanted)
    except BehaviourError:
        return Fraction(1) if unit.split() == wanted.split() else None
    if not one.same_dimension(other) or 0 in (one.scale, other.scale):
        return None
    if one.scale == other.scale:
        return Fraction(1)
    factor = one.scale / other.scale
    return factor if isinstance(factor, Fraction) else None


def _raised(unit: Unit, power: int) -> Unit:
    result = NONE
    for _ in range(abs(power)):
        result = result.times(unit)
    return result if power >= 0 else NONE.times(result, -1)


def unfamiliar(text: str) -> dict[str, str | None]:
    """The words of a unit that are not known, each with the known one it may be a misspelling of."""
    words = [_word_and_power(factor)[0] for factor in _FACTOR.finditer(text)]
    near = {word: get_close_matches(word, _KNOWN, n=1, cutoff=0.7) for word in words if word not in _KNOWN}
    return {word: matches[0] if matches else None for word, matches in near.items()}
