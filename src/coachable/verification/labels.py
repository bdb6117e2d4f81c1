"""How coordinates are written for people: `dtheta_1` as θ̇1, grouped by their unit."""

from collections.abc import Iterator, Sequence
from itertools import groupby

from coachable.behaviours.notation import pretty_name
from coachable.plants.plant import Plant

_DIGITS = str.maketrans("₀₁₂₃₄₅₆₇₈₉", "0123456789")


def label(name: str) -> str:
    """`dtheta_1` as θ̇1, with a plain digit, which every terminal has."""
    return pretty_name(name).translate(_DIGITS)


def section_labels(plant: Plant) -> str:
    """The section's coordinates: `(β, θ̇1, θ̇2)`."""
    return f"({', '.join(map(label, plant.section_names))})"


def section_units(plant: Plant) -> tuple[str, ...]:
    """The unit of each of the section's coordinates; empty where the plant gives none."""
    in_state = dict(zip(plant.state_names, plant.state_units, strict=False))
    return plant.section_units or tuple(in_state.get(name, "") for name in plant.section_names)


def with_units(names: Sequence[str], units: Sequence[str]) -> str:
    """`β [rad], θ̇1, θ̇2 [rad/s]`."""
    return ", ".join(
        ", ".join(names) + (f" [{unit}]" if unit else "") for names, unit in _by_unit(names, units)
    )


def point_text(names: Sequence[str], units: Sequence[str], values: Sequence[float]) -> str:
    """`β = 0.327000 rad, θ̇1 = -1.190500, θ̇2 = -0.048500 rad/s`."""
    texts = [f"{name} = {value:.6f}" for name, value in zip(names, values, strict=True)]
    return ", ".join(
        ", ".join(texts) + (f" {unit}" if unit else "") for texts, unit in _by_unit(texts, units)
    )


def actuators(plant: Plant) -> tuple[str, ...]:
    """Where each control acts, in words: `ankle`, `hip`; the controls' names where the plant gives none."""
    return plant.actuators or plant.control_names


def control_unit(plant: Plant) -> str:
    """The controls' common unit; empty where they have none."""
    units = set(plant.control_units)
    return units.pop() if len(units) == 1 else ""


def _by_unit(texts: Sequence[str], units: Sequence[str]) -> Iterator[tuple[list[str], str]]:
    for unit, group in groupby(zip(texts, units, strict=True), key=lambda pair: pair[1]):
        yield [text for text, _ in group], unit
