"""A passport, and a table of many, in the terminal."""

from __future__ import annotations

import json
import math
from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING

from rich.console import Console, Group
from rich.padding import Padding
from rich.table import Table
from rich.text import Text

from coachable.foundation.files import write_atomic
from coachable.foundation.suggestion import in_a_row
from coachable.verification.labels import (
    actuators,
    control_unit,
    label,
    point_text,
    section_units,
    with_units,
)
from coachable.verification.passport.walkers_table import walkers_csv
from coachable.verification.proportion import Proportion
from coachable.verification.robustness.basin import SECONDS, Basin
from coachable.verification.robustness.pushes import ENOUGH
from coachable.verification.robustness.pushes import SECONDS as PUSH_SECONDS

if TYPE_CHECKING:
    from coachable.plants.plant import Plant
    from coachable.verification.gait.adherence import Adherence, Transition
    from coachable.verification.gait.orbit import Orbit
    from coachable.verification.gait.stability import Stability
    from coachable.verification.passport.passport import Certified, FallSearch, Passport
    from coachable.verification.robustness.pushes import Pushes, Tolerance

_COLUMNS = ("setup", "walkers", "up", "k=1", "k>1", "wander", "stable", "|λ|", "cycles", "x₀", "section")
_LEGEND = (
    "up: after 100 s. k=1, k>1, wander: the gait with the touchdown clock repeats every step, every 2 or 4, "
    "or never. stable: all multipliers within the unit circle. |λ|: the largest, median of those that "
    "repeat. cycles: completed in 100 s, median of those up. x₀, section: percentage of starts from these "
    "boxes that reach the gait, mean of all walkers. proven: with a certificate."
)
_ENVIRONMENT_COLUMNS = ("setup", "walkers", "up", "% up", "in phases", "cycles", "push", "fall found")
_ENVIRONMENT_LEGEND = (
    "up: in every episode. % up: of the episodes, mean. in phases: percentage of the samples, mean. cycles: "
    "completed in all episodes, median. push: of the actions, in halves of their range, that 95 % of the "
    "episodes survive, median. fall found: walkers with a counterexample, of those searched."
)
_TITLE = "Gait passports by setup"


def print_passport(passport: Passport, plant: Plant | None, console: Console) -> None:
    """Print a whole passport, with the names of the plant that it is about, if it is about one."""
    walker = passport.walker
    about = walker.environment or f"{walker.semantics} semantics, {walker.clock} clock"
    parts: list[object] = [
        Text(f"{walker.name}: {passport.verdict}", style="bold"),
        Text(f"{about}, level {passport.level}", style="dim"),
        *(
            [Text(f"a controller with a memory: observes {in_a_row(walker.memory)}, too", style="dim")]
            if walker.memory
            else []
        ),
        *_section("adherence", _adherence(passport.adherence)),
    ]
    if walker.no_section is not None:
        parts += _section("orbit, stability, basin, certificate", [("none", walker.no_section)])
    console.print(Group(*parts))  # pyright: ignore[reportArgumentType]
    if plant is not None:
        _print_gait(passport, plant, console)
    elif passport.pushes is not None:
        console.print(Padding(_survival(passport.pushes), (1, 0, 0, 2)))
    if passport.falls:
        again = "SciPy" if plant is not None else "an environment made anew"
        rows = [row for search in passport.falls for row in _falls(search, again)]
        title = f"looked for falls within {passport.falls[0].seconds:g} s; none found is no proof"
        console.print(Group(*_section(title, rows)))  # pyright: ignore[reportArgumentType]
    if passport.certificate is not None and plant is not None:
        rows = _certificate(passport.certificate)
        console.print(Group(*_section("certificate, touchdown clock", rows)))  # pyright: ignore


def _print_gait(passport: Passport, plant: Plant, console: Console) -> None:
    """What is known of a plant's gait alone: orbits, stability, basins and what it withstands."""
    parts: list[object] = []
    if passport.orbits is not None:
        parts += _section("orbit, free clock", _orbit(passport.orbits.free, plant))
        parts += _section("orbit, touchdown clock", _orbit(passport.orbits.touchdown, plant))
    if passport.stability is not None:
        parts += _section("stability, touchdown clock", _stability(passport.stability, plant))
    if passport.basins:
        near = ", ".join(f"{width:g}" for width in plant.section_near)
        names = ", ".join(map(label, plant.section_names))
        title = f"basin: within {SECONDS:g} s at the gait (± {near} in {names})"
        parts += _section(title, [_basin(basin, plant) for basin in passport.basins])
    console.print(Group(*parts))  # pyright: ignore[reportArgumentType]
    if passport.pushes is not None:
        console.print(Padding(_pushes(passport), (1, 0, 0, 2)))
        if not plant.disturbances().changes:
            note = f"no constants of {plant.name} were changed: it gives none that can be"
            console.print(Padding(Text(note, style="dim"), (0, 0, 0, 2)))


def print_summary(passports: Sequence[Passport], console: Console) -> None:
    """Print a table with one row for each setup."""
    header, *rows = _summary(passports)
    table = Table(title=_TITLE, title_justify="left", title_style="bold", box=None)
    table.padding, table.pad_edge = (0, 1, 0, 0), False
    for index, name in enumerate(header):
        table.add_column(name, justify="right" if index else "left", no_wrap=True)
    for row in rows:
        table.add_row(*row)
    console.print(table)
    console.print(_legend(passports), style="dim")
    for line in _counts(passports):
        console.print(line)


def write_summary(passports: Sequence[Passport], folder: Path) -> None:
    """Write the same table beside the passports: as `summary.md`, and as `summary.json` for the report.

    Beside it lies `walkers.csv`, a row a walker.
    """
    header, *rows = _summary(passports)
    ruled = [header, ["---"] + ["---:"] * (len(header) - 1), *rows]
    lines = ["| " + " | ".join(cell.replace("|", "\\|") for cell in row) + " |" for row in ruled]
    note = "\n\n".join([_legend(passports), *_counts(passports)])
    write_atomic(folder / "summary.md", f"# {_TITLE}\n\n" + "\n".join(lines) + f"\n\n{note}\n")
    data = {"title": _TITLE, "header": header, "rows": rows, "note": note}
    write_atomic(folder / "walkers.csv", walkers_csv(passports))
    write_atomic(folder / "summary.json", json.dumps(data, indent=2, ensure_ascii=False) + "\n")


def _counts(passports: Sequence[Passport]) -> list[str]:
    """What a table of setups has no column for, with Clopper and Pearson's 95 % intervals in percent."""
    setups = dict.fromkeys(passport.walker.setup for passport in passports)
    ups = []
    for setup in setups:
        own = [one for one in passports if one.walker.setup == setup]
        low, high = Proportion(sum(one.adherence.up for one in own), len(own)).interval
        ups.append(f"{setup or 'baseline'} [{100 * low:.0f}, {100 * high:.0f}]")
    up = [one for one in passports if one.adherence.up]
    closed = sum(any(one.adherence.cycles.values()) for one in up)
    when = "in every episode" if _in_environment(passports) else "after 100 s"
    counts = [f"Up {when}, 95 % interval in percent: {', '.join(ups)}."]
    if not _in_environment(passports):
        counts.append(f"Of {_many(len(passports), 'walker', 'walkers')}, {_clocks(passports)}.")
    counts.append(
        f"Of the {_many(len(up), 'that is up', 'that are up')}, "
        f"{_many(closed, 'completes', 'complete')} a described cycle at least once."
    )
    searched = [one for one in passports if one.falls]
    if searched:
        safe = sum(not any(search.confirmed for search in one.falls) for one in searched)
        found = [
            (one.first_fall or math.inf, one.first_fall_at_random or math.inf)
            for passport in searched
            for one in passport.falls
        ]
        sooner, later = sum(a < b for a, b in found), sum(b < a for a, b in found)
        counts.append(
            f"Of {_many(len(searched), 'walker', 'walkers')} searched for falls, "
            f"{_many(safe, 'has', 'have')} no counterexample; CMA-ES saw the first fall before random search "
            f"{_many(sooner, 'time', 'times')}, after it {_many(later, 'time', 'times')}."
        )
    return counts


def _clocks(passports: Sequence[Passport]) -> str:
    """How many repeat themselves and how many wander under each clock."""
    kinds = {
        clock: [getattr(one.orbits, clock).kind for one in passports].count for clock in ("free", "touchdown")
    }
    return " and ".join(
        f"with the {clock} clock {_many(count('periodic'), 'repeats itself', 'repeat themselves')} and "
        f"{_many(count('wandering'), 'wanders', 'wander')}"
        for clock, count in kinds.items()
    )


def _in_environment(passports: Sequence[Passport]) -> bool:
    """Whether they are about a Gymnasium environment."""
    return any(one.walker.environment is not None for one in passports)


def _legend(passports: Sequence[Passport]) -> str:
    if not _in_environment(passports):
        return _LEGEND
    return f"{_ENVIRONMENT_LEGEND} There is {next(one.walker.no_section for one in passports)}."


def _many(number: int, one: str, more: str) -> str:
    return f"{number} {one if number == 1 else more}"


def _summary(passports: Sequence[Passport]) -> list[list[str]]:
    """The header and a row a setup; who was certified only if that was tried."""
    setups = dict.fromkeys(passport.walker.setup for passport in passports)
    if _in_environment(passports):
        rows = [
            _environment_row(setup, [one for one in passports if one.walker.setup == setup])
            for setup in setups
        ]
        return [[*_ENVIRONMENT_COLUMNS], *rows]
    tried = any(passport.certificate is not None for passport in passports)
    rows = []
    for setup in setups:
        own = [passport for passport in passports if passport.walker.setup == setup]
        proven = sum(one.certificate is not None and one.certificate.proven for one in own)
        rows.append([*_summary_row(setup, own), *([str(proven)] if tried else [])])
    return [[*_COLUMNS, *(["proven"] if tried else [])], *rows]


def _summary_row(setup: str | None, passports: Sequence[Passport]) -> list[str]:
    up = [one for one in passports if one.walks]
    orbits = [one.orbits.touchdown for one in passports if one.orbits is not None]
    multipliers = [one.stability.largest for one in passports if one.stability is not None]
    stable = [one for one in passports if one.stability is not None and one.stability.verdict == "stable"]
    return [
        setup or "",
        str(len(passports)),
        str(len(up)),
        str(sum(orbit.num_steps == 1 for orbit in orbits)),
        str(sum(orbit.num_steps > 1 for orbit in orbits)),
        str(sum(orbit.kind == "wandering" for orbit in orbits)),
        str(len(stable)),
        _median(multipliers, ".3f"),
        _median([sum(one.adherence.cycles.values()) for one in up], ".0f"),
        *(_mean_share(passports, name) for name in ("start", "section")),
    ]


def _environment_row(setup: str | None, passports: Sequence[Passport]) -> list[str]:
    seen = [one.adherence for one in passports]
    stayed = [one.episodes.share for one in seen if one.episodes is not None]
    pushed = [one.pushes.tolerances[0].amount for one in passports if one.pushes is not None]
    searched = [one for one in passports if one.falls]
    fell = sum(any(search.confirmed for search in one.falls) for one in searched)
    return [
        setup or "",
        str(len(passports)),
        str(sum(one.up for one in seen)),
        f"{100 * sum(stayed) / len(stayed):.1f}",
        f"{100 * sum(one.share_in_phases for one in seen) / len(seen):.1f}",
        _median([sum(one.cycles.values()) for one in seen], ".0f"),
        _median(pushed, "g"),
        f"{fell} of {len(searched)}" if searched else "–",
    ]


def _mean_share(passports: Sequence[Passport], name: str) -> str:
    shares = [sum(basin.reached.share for basin in one.basins if basin.starts == name) for one in passports]
    return f"{100 * sum(shares) / len(shares):.1f}"


def _median(values: Sequence[int | float], form: str) -> str:
    if not values:
        return "–"
    ordered, middle = sorted(values), len(values) // 2
    median = ordered[middle] if len(values) % 2 else (ordered[middle - 1] + ordered[middle]) / 2
    return f"{median:{form}}"


def _section(title: str, rows: Sequence[tuple[str, str]]) -> list[object]:
    grid = Table.grid(padding=(0, 2))
    grid.add_column(min_width=18, no_wrap=True)
    grid.add_column()
    for what, value in rows:
        grid.add_row(what, Text(value))  # a unit in brackets is no markup
    return [Text(), Text(f"  {title}", style="bold"), Padding(grid, (0, 0, 0, 4))]


def _adherence(seen: Adherence) -> list[tuple[str, str]]:
    up = f"{seen.seconds:.0f} s" if seen.up else f"{seen.seconds:.2f} s, then it fell"
    if seen.episodes is not None:
        up = f"at the end of {_share(seen.episodes)} of {seen.episodes.total} episodes, {seen.seconds:.1f} s"
    shares = ", ".join(f"{name} {100 * share:.1f} %" for name, share in seen.phases.items())
    described = [one for one in seen.transitions if one.described]
    others = [one for one in seen.transitions if not one.described]
    return [
        ("up", up),
        (f"in {seen.behaviour}", f"{100 * seen.share_in_phases:.1f} % of the samples: {shares}"),
        ("edges", ", ".join(map(_transition, described)) or "none"),
        ("not edges", ", ".join(map(_transition, others)) or "none"),
        ("cycles", ", ".join(f"{count} × {name}" for name, count in seen.cycles.items()) or "none"),
        *(("violations" if index == 0 else "", text) for index, text in enumerate(_violations(seen))),
    ]


def _violations(seen: Adherence) -> list[str]:
    if seen.follows:
        return ["none"]
    kinds = zip(seen.violations.items(), seen.explained, strict=True)
    return [f"{count} × {kind}; first at {sentence}" for (kind, count), sentence in kinds]


def _transition(one: Transition) -> str:
    return f"{one.source or 'outside'} → {one.target or 'outside'} {one.count:,} ×"


def _orbit(orbit: Orbit, plant: Plant) -> list[tuple[str, str]]:
    if orbit.kind == "none":
        return [("gait", "none: it falls or stops")]
    repeats = "repeats every step" if orbit.num_steps == 1 else f"repeats every {orbit.num_steps} steps"
    wander = " / ".join(f"{width:.1e}" for width in orbit.wander)
    names, units = [label(name) for name in plant.section_names], section_units(plant)
    if orbit.kind == "wandering":
        gait = f"does not repeat; wanders by ± {wander} ({with_units(names, units)})"
    elif orbit.clock == "free":
        gait = f"{repeats}, to within ± {wander} ({with_units(names, units)})"
    else:
        gait = f"{repeats} (residual {orbit.residual:.0e})"
    points = [point_text(names, units, point) for point in orbit.points]
    transport = "unknown: the plant gives no power" if math.isnan(orbit.cost_of_transport) else ""
    return [
        ("gait", gait),
        *(("after touchdown" if index == 0 else "", point) for index, point in enumerate(points)),
        ("period", f"{orbit.period:.4f} s"),
        ("step length", f"{orbit.step_length:.4f} m"),
        ("speed", f"{orbit.speed:.3f} m/s"),
        ("cost of transport", transport or f"{orbit.cost_of_transport:.4f}"),
    ]


def _stability(found: Stability, plant: Plant) -> list[tuple[str, str]]:
    values = ", ".join(_complex(value) for value in found.multipliers)
    agreement = f"central differences differ by {found.disagreement:.0e}"
    rows = [
        ("verdict", f"{found.verdict}: largest |λ| = {found.largest:.6f}, error at most {found.error:.0e}"),
        ("multipliers λ", values),
        ("‖DP‖₂", f"{found.norm:.2f}; {agreement}"),
    ]
    if found.clip_margin is not None:
        clipped = ", ".join(
            f"{name} in {count}" for name, count in zip(actuators(plant), found.num_clipped, strict=True)
        )
        unit = control_unit(plant)
        rows.append(
            (
                "clipping",
                f"{clipped} of {found.num_samples} samples; "
                f"nearest a bound {found.clip_margin:.1e} {unit}".rstrip(),
            )
        )
    if found.sample_margin is not None:
        rows.append(("touchdown", f"{found.sample_margin:.1e} s from the nearest sample"))
    if found.kinks:
        rows.append(("kinks", "; ".join(found.kinks) + ": the multipliers say little"))
    return rows


def _complex(value: complex) -> str:
    if value.imag == 0:
        return f"{value.real:.6f}"
    return f"{value.real:.6f} {'+' if value.imag > 0 else '−'} {abs(value.imag):.6f} i"


def _basin(basin: Basin, plant: Plant) -> tuple[str, str]:
    return (
        f"{basin.reached.total:,} starts",
        f"{_box(basin, plant)}: {_share(basin.reached)}; fell {100 * basin.fell.share:.1f} %, "
        f"undecided {100 * basin.undecided.share:.1f} %",
    )


def _box(basin: Basin, plant: Plant) -> str:
    """The box that the starts were drawn from."""
    if basin.starts == "start":
        return "around x₀ (± " + ", ".join(f"{width:g}" for width in plant.start_box) + ")"
    return "on the section (" + ", ".join(f"{low:g} … {high:g}" for low, high in plant.section_box) + ")"


def _share(proportion: Proportion) -> str:
    low, high = proportion.interval
    return f"{100 * proportion.share:.1f} % ({100 * low:.1f} to {100 * high:.1f})"


def _falls(search: FallSearch, again: str) -> list[tuple[str, str]]:
    def first(walk: int | None) -> str:
        return "none" if walk is None else f"first in walk {walk:,}"

    tried = f"CMA-ES: {first(search.first_fall)}, at random: {first(search.first_fall_at_random)}"
    kept = _many(search.confirmed, "counterexample", "counterexamples")
    confirmed = f"{kept}, walked once more by {again}" if search.confirmed else ""
    unconfirmed = f"{search.unconfirmed} that {again} does not confirm" if search.unconfirmed else ""
    margin = f"least margin {search.least_margin:.3f}"
    result = ", ".join(filter(None, (confirmed, unconfirmed))) or f"no counterexample, {margin}"
    return [("within", search.within), (f"{search.walks:,} walks each", tried), ("result", result)]


def _certificate(found: Certified) -> list[tuple[str, str]]:
    if not found.proven:
        return [("none", found.reason)]
    steps = "one step" if found.strides == 1 else f"{found.strides} steps"
    rows = [
        ("proven", f"from anywhere in a box around the gait it is back in the box after {steps}: no fall"),
        ("box", f"± {found.radius:g} along each eigenvector; images reach {found.reach:.3f} of that"),
    ]
    return rows if found.file is None else [*rows, ("file", f"certificates/{found.file}")]


def _pushes(passport: Passport) -> Table:
    mine, baseline = passport.pushes, passport.baseline_pushes
    table = Table(
        title=f"pushes: the most that it takes and is up after {PUSH_SECONDS:g} s",
        title_justify="left",
        title_style="bold",
        box=None,
    )
    table.add_column("begun right after a touchdown")
    for name in (passport.walker.name, passport.baseline):
        if name is not None:
            table.add_column(name, justify="right")
    table.add_column("")
    assert mine is not None, "called only where there are pushes"
    for index, one in enumerate(mine.tolerances):
        other = [] if baseline is None else [_amount(baseline.tolerances[index])]
        table.add_row(one.what, _amount(one), *other, one.unit)
    table.add_row("torque one sample late", *(_yes(one) for one in (mine, baseline) if one is not None), "")
    return table


def _survival(pushes: Pushes) -> Table:
    title = f"pushes: episodes that are up after {PUSH_SECONDS:g} s"
    table = Table(title=title, title_justify="left", title_style="bold", box=None)
    table.add_column("at a moment and in a direction drawn anew for each episode")
    table.add_column("size", justify="right")
    table.add_column("")
    table.add_column("up", justify="right")
    for one in pushes.survival:
        table.add_row(one.what, f"{one.amount:g}" if one.amount else "", one.unit, _share(one.up))
    for one in pushes.tolerances:
        table.add_row(f"{100 * ENOUGH:g} % survive: {one.what}", _amount(one), one.unit, "")
    return table


def _amount(one: Tolerance) -> str:
    beyond = "≥ " if math.isclose(one.amount, one.tried) else ""
    return f"{beyond}{one.amount:.3f}"


def _yes(pushes: Pushes) -> str:
    return "survived" if pushes.delay_survived else "falls"
