"""Propose a box around a gait; whether it returns into itself only `checker` says."""

from __future__ import annotations

import math
import time
from collections.abc import Callable, Mapping
from dataclasses import dataclass, replace
from typing import Any

import jax
import numpy as np
from jaxtyping import Float

from coachable.foundation.errors import ParameterError
from coachable.verification.certificate.checker import CertificateError, Verdict, check
from coachable.verification.certificate.file import walker_data
from coachable.verification.gait.closed_loop import ClosedLoop, in_double
from coachable.verification.gait.orbit import Orbit, fixed_point

ORDER = 8
"""Of the Taylor polynomials. At order 6 their remainders keep boxes below 1e-6 from being proven."""
SUBSTEPS = 16
"""Runge–Kutta steps a control step, so that the centre is off by some 1e-11 and not by 1e-9."""
FIRST = (1e-5, 1e-6)
"""Radii of the boxes that are tried first [rad and rad/s, along unit eigenvectors], in one piece."""
LARGEST = 2e-2
ENOUGH = 0.95
"""A box whose images reach so much of its radius is not made larger."""
MOST_ATTEMPTS = 8


@dataclass(frozen=True)
class Attempt:
    """One box that was put to the checker."""

    radius: float
    subdivisions: int
    """Along each axis."""
    verdict: Verdict


@dataclass(frozen=True)
class Proposal:
    """The largest box that was proven, and what was tried."""

    certificate: Mapping[str, Any] | None
    """Its parts, to be written; `None` if nothing was proven."""
    attempts: tuple[Attempt, ...]
    multipliers: tuple[complex, ...]
    """Of DPᵏ at the fixed point."""
    norm: float
    """‖DPᵏ‖₂."""
    obstacle: str
    """Why nothing was proven, or else what bounds the radius."""

    @property
    def radius(self) -> float:
        """Of the box that was proven; 0 if none was."""
        return max((attempt.radius for attempt in self.attempts if attempt.verdict.proven), default=0.0)

    @property
    def verdict(self) -> Verdict | None:
        """What the checker said of the certificate's box, or else of the last one."""
        proven = [attempt for attempt in self.attempts if attempt.verdict.proven]
        best = max(proven, key=lambda attempt: attempt.radius, default=None)
        return best.verdict if best else self.attempts[-1].verdict if self.attempts else None


class _TimeIsUp(Exception):
    pass


def propose(
    loop: ClosedLoop,
    orbit: Orbit,
    about: Mapping[str, Any],
    *,
    seconds: float = 300.0,
    subdivisions: int = 10,
    progress: Callable[[float], None] = lambda done: None,
) -> Proposal:
    """Look for the largest box around a periodic orbit under the touchdown clock that the checker proves.

    Its axes are the eigenvectors of DPᵏ. A first small one shows whether there is a kink at the orbit; the
    others follow how images' reach grows with the radius.

    **Arguments:** `orbit`, a periodic one of this loop; `about`, what to write of whose certificate it is;
    `seconds`, after which no more is tried; `subdivisions` along each axis; `progress`, called with the
    fraction of the time used.

    **Raises:** `ParameterError` for a walker that certificates are not made for.
    """
    began, walker = time.monotonic(), walker_data(loop)
    with jax.enable_x64(True):
        found = fixed_point(in_double(replace(loop, num_substeps=SUBSTEPS)), orbit.points[0], orbit.num_steps)
    values, basis = eigenbasis(found.jacobian)
    facts = (tuple(complex(value) for value in values), float(np.linalg.norm(found.jacobian, 2)))
    contraction = _row_sum(basis, found.jacobian)
    strides = orbit.num_steps
    if contraction >= 0.95 and np.max(np.abs(values)) < 0.95:
        strides, contraction = 2 * strides, _row_sum(basis, found.jacobian @ found.jacobian)
    if not contraction < 1:
        return Proposal(None, (), *facts, f"the return map contracts by {contraction:.2f} only")

    parts = {
        "about": dict(about),
        **walker,
        "strides": strides,
    }
    step = parts["controller"]["hold"] or "0.01"
    attempts: list[Attempt] = []

    def on_time(_: float) -> None:
        share = (time.monotonic() - began) / seconds
        if share >= 1:
            raise _TimeIsUp
        progress(share)

    def boxed(radius: float, number: int) -> dict[str, Any]:
        return parts | {
            "box": {"centre": found.y.tolist(), "basis": basis.tolist(), "radii": [radius] * 3},
            "method": {"order": ORDER, "step": step, "subdivisions": [number] * 3},
        }

    def attempt(radius: float, number: int) -> Verdict:
        try:
            verdict = check(boxed(radius, number), on_time)
        except CertificateError as error:
            raise ParameterError(f"no certificate can hold this walker's numbers: {error}") from None
        attempts.append(Attempt(radius, number, verdict))
        return verdict

    try:
        for radius in FIRST:
            verdict = attempt(radius, 1)
            growth = (max(verdict.reach) - contraction) / radius
            if verdict.proven:
                break
        radius = rounded(min(LARGEST, (1 - contraction) / max(growth, 1.0) * subdivisions**2 / 2))
        while any(a.verdict.proven for a in attempts) and len(attempts) < MOST_ATTEMPTS:
            verdict = attempt(radius, subdivisions)
            best = max(a.radius for a in attempts if a.verdict.proven)
            failed = [a for a in attempts if not a.verdict.proven and a.subdivisions == subdivisions]
            bad = min((a.radius for a in failed), default=LARGEST)
            wanted = _next(radius, contraction, verdict)
            radius = rounded(wanted if wanted < bad else min(LARGEST, math.sqrt(best * bad)))
            if (verdict.proven and max(verdict.reach) >= ENOUGH) or radius < 1.05 * best:
                break
    except _TimeIsUp:
        pass
    proven = max((a for a in attempts if a.verdict.proven), key=lambda a: a.radius, default=None)
    reasons = [a.verdict.reason for a in attempts if not a.verdict.proven]
    obstacle = reasons[-1] if reasons else proven.verdict.reason if proven else "no time was left"
    certificate = boxed(proven.radius, proven.subdivisions) if proven else None
    return Proposal(certificate, tuple(attempts), *facts, obstacle)


def eigenbasis(
    jacobian: Float[np.ndarray, "3 3"],
) -> tuple[np.ndarray, Float[np.ndarray, "3 3"]]:
    """Eigenvalues, and real and imaginary parts of the unit eigenvectors as columns."""
    values, vectors = np.linalg.eig(jacobian)
    columns = []
    for value, vector in zip(values, vectors.T, strict=True):
        if value.imag >= 0:
            columns.append(vector.real)
        if value.imag > 0:
            columns.append(vector.imag)
    return values, np.stack(columns, axis=1)


def _row_sum(basis: np.ndarray, jacobian: np.ndarray) -> float:
    """How much of its radius a small box reaches: the largest row sum of |Q⁻¹ DP Q|."""
    return float(np.max(np.sum(np.abs(np.linalg.solve(basis, jacobian @ basis)), axis=1)))


def rounded(radius: float) -> float:
    """To two digits, downwards."""
    scale = 10.0 ** (math.floor(math.log10(radius)) - 1)
    return float(f"{math.floor(radius / scale) * scale:.1e}")


def _next(radius: float, contraction: float, verdict: Verdict) -> float:
    """The radius at which images would reach a little more than `ENOUGH`, were their reach linear in it."""
    reach = max(verdict.reach)
    if not reach > contraction:
        return radius / 3
    return radius * float(np.clip((ENOUGH + 0.02 - contraction) / (reach - contraction), 0.2, 8.0))
