"""Certificates that the tests try to break."""

import copy

import numpy as np

PLANT = {"hip_mass": "1.0", "leg_mass": "0.5", "a": "0.5", "b": "0.5", "gravity": "9.807"}


STEP = "0.02"
"""A torque is held for so long here, which makes half the steps of 0.01 s [s]."""


def certificate(y, basis, radius, *, slope="-0.07", held=True, hold=STEP, strides=1, cuts=2):
    """A claim about virtual gravity, as plain data."""
    return {
        "plant": dict(PLANT),
        "controller": {"kind": "virtual-gravity", "slope": slope, "hold": hold if held else None},
        "box": {"centre": list(map(float, y)), "basis": np.asarray(basis).tolist(), "radii": [radius] * 3},
        "strides": strides,
        "method": {"order": 6, "step": hold, "subdivisions": [cuts] * 3},
    }


def changed(data, *path_and_value):
    """The same with another value at a path of keys."""
    *path, last, value = path_and_value
    data = copy.deepcopy(data)
    inside = data
    for key in path:
        inside = inside[key]
    inside[last] = value
    return data
