"""A certificate as a file: the claim's numbers, how it is to be proven, and hashes that bind its parts."""

from __future__ import annotations

import json
from collections.abc import Callable, Mapping
from dataclasses import dataclass, fields
from decimal import Decimal
from pathlib import Path
from typing import Any

import equinox as eqx
import numpy as np

from coachable.foundation.data import parse_json, structure
from coachable.foundation.errors import ParameterError, RunFolderError
from coachable.foundation.files import hash_of, read_text, write_atomic
from coachable.learning.policy import Policy
from coachable.plants.compass import STATE_NAMES, CompassParameters, CompassWalker, VirtualGravity
from coachable.verification.certificate.checker import CertificateError, Verdict, check
from coachable.verification.gait.closed_loop import ClosedLoop

FORMAT, FORMAT_VERSION = "coachable certificate", 1
PARTS = ("about", "plant", "controller", "box", "strides", "method")
"""What a certificate consists of; each has a hash. `about` names whose it is, and no proof depends on it."""


@dataclass(frozen=True)
class _File:
    """What a certificate's file holds; the checker reads the parts by itself."""

    format: str
    format_version: int
    about: Any
    plant: Any
    controller: Any
    box: Any
    strides: Any
    method: Any
    sha256: Mapping[str, str]


def plant_data(parameters: CompassParameters) -> dict[str, str]:
    """The plant's constants as decimal numbers, the shortest that name the floats."""
    return {
        name: _decimal(getattr(parameters, name)) for name in ("hip_mass", "leg_mass", "a", "b", "gravity")
    }


def controller_data(loop: ClosedLoop) -> dict[str, Any]:
    """The controller's numbers: virtual gravity's slope as a decimal number, a network's weights exactly.

    Weights in float32 become the same numbers in float64.

    **Raises:** `ParameterError` for a controller or a plant that certificates are not made for: whatever
    moves the walker is in the numbers, or there are none.
    """
    controller, hold = loop.controller, None if loop.hold == "continuous" else _decimal(loop.control_dt)
    if type(loop.plant) is not CompassWalker:
        raise ParameterError(f"a certificate is about the compass walker, not about {loop.plant.name}")
    if loop.plant.backward_passing_counts:
        raise ParameterError("a certificate is about the semantics `paper`; this walker has `released-code`")
    if type(controller) is VirtualGravity and not controller.released:
        if controller.plant.parameters != loop.plant.parameters:
            raise ParameterError(
                "a certificate is about virtual gravity for the walker that it drives, but this one is for "
                f"{controller.plant.parameters}, and drives {loop.plant.parameters}"
            )
        return {"kind": "virtual-gravity", "slope": _decimal(controller.slope), "hold": hold}
    if isinstance(controller, Policy) and type(controller) is Policy and hold is not None:
        _require_plain(controller)
        return {
            "kind": "network",
            "hold": hold,
            "squashing": "expected"
            if controller.deterministic == "expected-action"
            else controller.squashing,
            "low": _floats(controller.low),
            "high": _floats(controller.high),
            **({} if controller.deterministic == "clipped-mean" else {"std": _floats(controller.std)}),
            "weights": [_floats(weight) for weight in controller.weights],
            "biases": [_floats(bias) for bias in controller.biases],
        }
    raise ParameterError(
        "a certificate can be made for virtual gravity and for tanh policies, not for "
        f"{type(controller).__name__} here"
    )


def walker_data(loop: ClosedLoop) -> dict[str, Any]:
    """The parts of a certificate that say which walker it is about: the plant, and the whole controller.

    **Raises:** `ParameterError` as `controller_data` does.
    """
    controller = controller_data(loop)
    return {"plant": plant_data(loop.plant.parameters), "controller": controller}


def _require_plain(policy: Policy) -> None:
    """Refuse a policy that is more than its weights, biases, bounds and squashing say."""
    plain = Policy(
        policy.weights,
        policy.biases,
        policy.low,
        policy.high,
        squashing=policy.squashing,
        std=policy.std,
        deterministic=policy.deterministic,
        observation_names=STATE_NAMES if policy.observation_names else (),
        clock=policy.clock,
        bound=policy.bound,
    )
    names = [field.name for field in fields(policy)]
    others = [n for n in names if not eqx.tree_equal(getattr(policy, n), getattr(plain, n))]
    if others:
        raise ParameterError(
            f"a certificate is about a tanh network of the state {', '.join(STATE_NAMES)} as it is, "
            f"without this policy's {', '.join(others)}; train without, or verify without a certificate"
        )


def write_certificate(path: Path, parts: Mapping[str, Any]) -> None:
    """Write a certificate with the hashes of its parts, whole or not at all."""
    whole = {name: parts[name] for name in PARTS}
    data = {
        "format": FORMAT,
        "format_version": FORMAT_VERSION,
        **whole,
        "sha256": {name: part_hash(part) for name, part in whole.items()},
    }
    lines = ",\n".join(f"{json.dumps(name)}: {json.dumps(part)}" for name, part in data.items())
    write_atomic(path, f"{{\n{lines}\n}}\n")


def read_certificate(path: Path) -> dict[str, Any]:
    """The certificate in a file; its parts are what was written, but nothing is proven yet.

    **Raises:** `RunFolderError` naming the file and what is wrong with it.
    """
    data = parse_json(read_text(path), str(path), RunFolderError)
    if data.get("format") != FORMAT:
        raise RunFolderError(f"{path} is not a certificate")
    if data.get("format_version") != FORMAT_VERSION:
        raise RunFolderError(
            f"{path} has format_version {data.get('format_version')!r}; this coachable reads {FORMAT_VERSION}"
        )
    file = structure(_File, data, f"{path} is damaged", RunFolderError)
    for name in PARTS:
        if file.sha256.get(name) != part_hash(data[name]):
            raise RunFolderError(f"{path} was changed after it was written: its {name!r} is another")
    return data


def recheck(
    path: str | Path,
    loop: ClosedLoop | None = None,
    progress: Callable[[float], None] = lambda done: None,
) -> Verdict:
    """Prove the claim of a certificate file anew, by the checker alone, from the numbers in the file.

    **Arguments:** `loop`, the walker that it is said to be about: its constants and its controller's numbers
    must be those in the file; `progress`, called with the fraction done.

    **Raises:** `RunFolderError` for a file that is damaged, was changed, or is about another walker;
    `ParameterError` for a walker that no certificate can be about, such as a policy that normalises what it
    observes.
    """
    path = Path(path)
    data = read_certificate(path)
    if loop is not None:
        for name, own in walker_data(loop).items():
            if data[name] != own:
                raise RunFolderError(f"{path} is about another walker: its {name} is not this one's")
    try:
        return check(data, progress)
    except CertificateError as error:
        raise RunFolderError(f"{path} is damaged: {error}") from None


def part_hash(part: Any) -> str:
    """SHA-256 of a part, as JSON with its keys in order."""
    return hash_of(json.dumps(part, sort_keys=True, separators=(",", ":")).encode())


def _decimal(number: float) -> str:
    return f"{Decimal(repr(float(number))):f}"


def _floats(array: Any) -> list:
    return np.asarray(array).astype(np.float64).tolist()
