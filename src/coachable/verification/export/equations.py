"""The walker's equations as text that KeYmaera X, SpaceEx and Python read alike.

A name is letters, then an index if need be, for KeYmaera X knows no others. Every formula is made of numbers,
names, + − * /, parentheses, sin and cos.
"""

from __future__ import annotations

import re
from collections.abc import Mapping
from decimal import Decimal
from types import MappingProxyType

from coachable.plants.compass import STATE_NAMES, CompassParameters, VirtualGravity
from coachable.plants.controllers import ConstantTorque, NoTorque

Definitions = Mapping[str, str]
"""Formulas by name, each after those that it speaks of."""

VARIABLES = (*STATE_NAMES, "u_1", "u_2")
"""What changes while the walker flows, but time."""

DERIVED: Definitions = MappingProxyType(
    {
        "leg": "a + b",
        "inertia_1": "(hipmass + legmass) * leg * leg + legmass * a * a",
        "inertia_2": "legmass * b * b",
        "coupling": "legmass * b * leg",
        "weight_1": "(hipmass * leg + legmass * (a + leg)) * g",
        "weight_2": "legmass * b * g",
        "lever": "leg / b",
    }
)
"""What follows from the walker's constants alone."""

SHARED: Definitions = MappingProxyType(
    {
        "cosine": "cos(theta_1 - theta_2)",
        "sine": "sin(theta_1 - theta_2)",
        "inertia": "inertia_1 - legmass * leg * leg * cosine * cosine",
    }
)
"""What the flow and the impact have in common; `inertia` is det M over the swing leg's."""

FLOW: Definitions = MappingProxyType(
    {
        "stance": "u_1 + u_2 + coupling * sine * dtheta_2 * dtheta_2 + weight_1 * sin(theta_1)",
        "swing": "-u_2 - coupling * sine * dtheta_1 * dtheta_1 - weight_2 * sin(theta_2)",
        "ddtheta_1": "(stance + lever * cosine * swing) / inertia",
        "ddtheta_2": "swing / inertia_2 + lever * cosine * ddtheta_1",
    }
)
"""M(θ) θ̈ + C(θ, θ̇) θ̇ + g(θ) = S u, solved for θ̈."""

RATES: Mapping[str, str] = MappingProxyType(
    {"theta_1": "dtheta_1", "theta_2": "dtheta_2", "dtheta_1": "ddtheta_1", "dtheta_2": "ddtheta_2"}
)
"""What each coordinate's derivative in time is called."""

IMPACT: Definitions = MappingProxyType(
    {
        "momentum": "(hipmass * leg + legmass * a) * leg * cosine * dtheta_1 - legmass * a * b * dtheta_2",
        "after_1": "momentum / inertia",
        "after_2": "lever * cosine * after_1 - a / b * dtheta_1",
        "steplength": "leg * (sin(theta_2) - sin(theta_1))",
    }
)
"""T⁺ θ̇⁺ = T⁻ θ̇⁻, solved for the velocities after it; the angles change places."""


def constants_of(p: CompassParameters) -> dict[str, float]:
    """The walker's constants [kg, m, m/s²]."""
    return {"hipmass": p.hip_mass, "legmass": p.leg_mass, "a": p.a, "b": p.b, "g": p.gravity}


def torques_of(controller: VirtualGravity | ConstantTorque | NoTorque) -> dict[str, str]:
    """What a baseline asks for, `torque_1` at the ankle and `torque_2` at the hip [N m]."""
    match controller:
        case VirtualGravity(slope=slope, released=released):
            leg_angle = "dtheta_1" if released else "theta_2"
            return {
                "pull": f"sin({decimal(slope)}) / cos({decimal(slope)})",
                "torque_2": f"weight_2 * pull * cos({leg_angle})",
                "torque_1": "weight_1 * pull * cos(theta_1) - torque_2",
            }
        case ConstantTorque(torque=(ankle, hip)):
            return {"torque_1": decimal(ankle), "torque_2": decimal(hip)}
        case _:
            return {"torque_1": "0", "torque_2": "0"}


def decimal(value: float) -> str:
    """A float as the shortest decimal that is read back as the same float, without an exponent."""
    return format(Decimal(repr(float(value))), "f").removesuffix(".0")


def inlined(text: str, definitions: Definitions) -> str:
    """The text with every defined name in it replaced by its formula, and so on in there."""

    def spelt_out(match: re.Match[str]) -> str:
        name = match[0]
        return f"({inlined(definitions[name], definitions)})" if name in definitions else name

    return _NAME.sub(spelt_out, text)


def depends_on(text: str, definitions: Definitions) -> tuple[str, ...]:
    """Which of `VARIABLES` a text speaks of, also through its definitions, in their order."""
    names = set(_NAME.findall(inlined(text, definitions)))
    return tuple(name for name in VARIABLES if name in names)


_NAME = re.compile(r"[A-Za-z]\w*")
