"""A row a walker: what passports say of each, for a spreadsheet or a data frame."""

from __future__ import annotations

import csv
import io
import math
from collections.abc import Sequence

from coachable.verification.passport.passport import Passport


def walkers_csv(passports: Sequence[Passport]) -> str:
    """The passports as CSV, a row each; empty where a number does not exist."""
    out = io.StringIO()
    rows = [_row(passport) for passport in passports]
    writer = csv.DictWriter(out, list(rows[0]), lineterminator="\n")
    writer.writeheader()
    writer.writerows({name: _text(value) for name, value in row.items()} for row in rows)
    return out.getvalue()


def _row(passport: Passport) -> dict[str, object]:
    walker, seen, proof = passport.walker, passport.adherence, passport.certificate
    gait = None if passport.orbits is None else passport.orbits.touchdown
    stable = passport.stability
    reached = {basin.starts: basin.reached.share for basin in passport.basins}
    return {
        "walker": walker.name,
        "setup": walker.setup,
        "seed": walker.seed,
        "seconds": seen.seconds,
        "up": seen.up,
        "share_in_phases": seen.share_in_phases,
        "cycles": sum(seen.cycles.values()),
        "gait": None if gait is None else gait.kind,
        "repeats_every": None if gait is None else gait.num_steps,
        "speed": None if gait is None else gait.speed,
        "stability": None if stable is None else stable.verdict,
        "multiplier_of_a_step": None
        if stable is None or gait is None
        else stable.largest ** (1 / gait.num_steps),
        "norm": None if stable is None else stable.norm,
        "reached_from_start": reached.get("start"),
        "reached_from_section": reached.get("section"),
        "proven": None if proof is None else proof.proven,
        "radius": proof.radius if proof is not None and proof.proven else None,
        "reach": proof.reach if proof is not None and proof.proven else None,
        "no_proof_because": proof.reason if proof is not None and not proof.proven else None,
    }


def _text(value: object) -> object:
    if isinstance(value, float):
        return f"{value:.6g}" if math.isfinite(value) else ""
    return "" if value is None else value
