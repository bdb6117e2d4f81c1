"""A small compass walker in the posture of a phase, as in figure 3 of the paper."""

from __future__ import annotations

import math
from collections.abc import Callable

from coachable.behaviours.behaviour import Behaviour, Phase
from coachable.behaviours.expressions import Number, Variable
from coachable.behaviours.predicates import Comparison
from coachable.behaviours.rewriting import conjuncts
from coachable.diagram.layout import Point
from coachable.diagram.routing import arrow_head
from coachable.foundation.style import STANCE, SWING

COLOURS = {"theta_1": STANCE, "dtheta_1": STANCE, "theta_2": SWING, "dtheta_2": SWING}
"""The leg that a signal belongs to, as its colour."""

WIDTH = 92.0
"""The width of a pictogram [px]."""

_LEG = 56.0
_STANCE_ANGLE, _SWING_ANGLE = 0.2, 0.46
_SWEEP = (0.15, 0.4)
_HEAD = 6.5


def is_walker(behaviour: Behaviour) -> bool:
    """Whether a behaviour has the signals of a compass walker, so that its phases can be pictured."""
    return set(COLOURS) <= set(behaviour.signal_names)


def pictogram(phase: Phase, x: float, y: float) -> str:
    """SVG of the walker in a phase, centred at (x, y); empty if a signal has no sign in it.

    The legs lean and the arrows point by the signs of angles and velocities; their sizes are fixed.
    """
    signs = _signs(phase)
    if not set(COLOURS) <= set(signs):
        return ""
    stance, swing = _STANCE_ANGLE * signs["theta_1"], _SWING_ANGLE * signs["theta_2"]
    hip_x, toe_x = -math.sin(stance), math.sin(swing) - math.sin(stance)
    middle = (min(0, hip_x, toe_x) + max(0, hip_x, toe_x)) / 2
    foot = (x - _LEG * middle, y + _LEG / 2)

    def hip_at(angle: float) -> Point:
        return foot[0] - _LEG * math.sin(angle), foot[1] - _LEG * math.cos(angle)

    hip = hip_at(stance)

    def toe_at(angle: float) -> Point:
        return hip[0] + _LEG * math.sin(angle), hip[1] + _LEG * math.cos(angle)

    return "".join(
        [
            f'<path class="ground" d="M{x - WIDTH / 2:.1f} {foot[1]:.1f}h{WIDTH:.1f}"/>',
            _leg("swing", hip, toe_at(swing)),
            _leg("stance", foot, hip),
            f'<circle class="hip" cx="{hip[0]:.1f}" cy="{hip[1]:.1f}" r="5"/>',
            _motion("stance", hip_at, stance, signs["dtheta_1"]),
            _motion("swing", toe_at, swing, signs["dtheta_2"]),
        ]
    )


def _leg(name: str, start: Point, end: Point) -> str:
    (x0, y0), (x1, y1) = start, end
    line = f'<path class="leg {name}" d="M{x0:.1f} {y0:.1f}L{x1:.1f} {y1:.1f}"/>'
    return line + f'<circle class="mass {name}" cx="{(x0 + x1) / 2:.1f}" cy="{(y0 + y1) / 2:.1f}" r="3.2"/>'


def _motion(leg: str, point_at: Callable[[float], Point], angle: float, sign: int) -> str:
    """An arrow from where a point is on its circle to where its angle takes it."""
    (x0, y0), (x1, y1), tip = (point_at(angle + sign * part) for part in (*_SWEEP, _SWEEP[1] + 0.1))
    # Both angles are positive counterclockwise, and SVG counts clockwise as positive.
    arc = f"M{x0:.1f} {y0:.1f}A{_LEG} {_LEG} 0 0 {int(sign < 0)} {x1:.1f} {y1:.1f}"
    head = arrow_head(tip, (x1, y1), _HEAD)
    return f'<path class="motion {leg}" d="{arc}"/><path class="{leg}-head" d="{head}"/>'


def _signs(phase: Phase) -> dict[str, int]:
    """The sign that a phase gives to each signal it compares with zero."""
    return {
        part.left.signal: 1 if part.relation in (">", ">=") else -1
        for part in conjuncts(phase.predicate)
        if isinstance(part, Comparison) and isinstance(part.left, Variable) and part.right == Number(0)
    }
