"""What rewards leave open, and how long phases may last: audit, limits."""

from __future__ import annotations

import sys
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

from tyro.conf import Positional, arg

from coachable.cli.options import (
    BASELINE,
    BehaviourName,
    PlantOfBaseline,
    option,
    output,
    plant_of_baseline,
    print_json,
    require_no_input,
    require_suffix,
)
from coachable.foundation.errors import CoachableError

if TYPE_CHECKING:
    from coachable.rewards.audit import Exploit


def audit(
    behaviour: BehaviourName,
    form: Annotated[
        str | None,
        option("FORM", "One reward form, with the runs that earn the most.", otherwise="all that can pay it"),
    ] = None,
    skip_fine: Annotated[
        float, arg(metavar="PHI", help="Of the form schedule: the fine for a phase passed over, 0 to 1.")
    ] = 1.0,
    dt: Annotated[float, arg(metavar="SECONDS", help="Time between two samples.")] = 0.01,
    slower: Annotated[
        float | None, option("SECONDS", "Also runs that take longer than this to go round, on average.")
    ] = None,
    faster: Annotated[
        float | None, option("SECONDS", "Also runs that go round in less time than this, on average.")
    ] = None,
    json: Annotated[bool, arg(help="Print JSON.")] = False,
) -> None:
    """Report the most that a reward pays for not following a behaviour.

    That is for staying in one phase, for leaving one out, and for never going round: the mean pay a sample,
    exact, the maximum mean cycle of all that form and clocks can remember. For example:

        coachable audit compass-walking
        coachable audit compass-walking-timed --form schedule
        coachable audit compass-walking-timed --form schedule --slower 0.9 --faster 0.3
        coachable audit mine.behaviour --form schedule --skip-fine 0 --dt 0.02 --json
    """
    from coachable.behaviours.library import load_behaviour
    from coachable.foundation.errors import ParameterError
    from coachable.rewards.audit import audit as audited
    from coachable.rewards.forms import Schedule, form_of
    from coachable.rewards.forms.tables import VARIANTS

    described = load_behaviour(behaviour)
    names = (*VARIANTS, "schedule") if form is None else (form,)
    audits, refused = {}, {}
    for name in names:
        try:
            audits[name] = audited(
                described,
                Schedule(skip_fine) if name == "schedule" else form_of(name),
                dt,
                slower,
                faster,
            )
        except ParameterError as error:
            if form is not None or not described.cycles:
                raise
            refused[name] = str(error)
    if json:
        print_json(
            {
                name: {exploit.kind: _exploit(exploit) for exploit in found.exploits}
                for name, found in audits.items()
            }
        )
        return
    kinds = list(dict.fromkeys(each.kind for found in audits.values() for each in found.exploits))
    width = max(map(len, kinds))
    print(f"{described.name}: the greatest mean pay a sample of a run that", "", sep="\n")
    print(" " * width + "".join(f"{name:>10}" for name in audits))
    paid = {name: {each.kind: each for each in found.exploits} for name, found in audits.items()}
    for kind in kinds:
        shown = (f"{by[kind].mean:>10.2f}" if kind in by else f"{'–':>10}" for by in paid.values())
        period = "" if form is None or kind not in paid[form] else f"   {_periods(paid[form][kind])}"
        print(f"{kind:<{width}}{''.join(shown)}{period}")
    for name, reason in refused.items():
        print(f"\nNot {name}: {reason}.")


def _exploit(exploit: Exploit) -> dict[str, object]:
    beside = {} if exploit.beside is None else {"share": exploit.share, "beside": _exploit(exploit.beside)}
    periods = {"approach": exploit.approach.stays, "period": exploit.period.stays}
    return {"mean": exploit.mean, **periods, **beside}


def _periods(exploit: Exploit) -> str:
    """The period, or both with their shares of the samples."""
    if exploit.beside is None:
        return str(exploit.period)
    return f"{exploit.share:.0%}: {exploit.period}; {exploit.beside.share:.0%}: {exploit.beside.period}"


def limits(
    behaviour: BehaviourName,
    trace: Annotated[
        Positional[Path | None],
        arg(
            metavar="TRACE",
            help="A recorded motion as it should be, as explain takes it.",
            help_behavior_hint="(default: the walk of --baseline)",
        ),
    ] = None,
    baseline: Annotated[str | None, option("BASELINE", f"Measure {BASELINE}.")] = None,
    plant: PlantOfBaseline = None,
    dt: Annotated[
        float | None, option("SECONDS", "Time between two rows.", otherwise="the column t or time")
    ] = None,
    quantile: Annotated[float, arg(metavar="SHARE", help="The share of stays that have enough time.")] = 0.9,
    slack: Annotated[float, arg(metavar="FACTOR", help="How much more time than that is left.")] = 1.0,
    out: Annotated[
        Path | None, output("FILE", "x.behaviour, the description with the limits.", otherwise="not written")
    ] = None,
    json: Annotated[bool, arg(help="Print JSON.")] = False,
) -> None:
    """Propose how long each phase may last, from a motion that follows the description.

    The reward form `schedule` needs a limit for every phase on a cycle. For example:

        coachable limits compass-walking --baseline virtual-gravity
        coachable limits mine.behaviour walk.csv --slack 1.25 -o timed.behaviour
    """
    import numpy as np

    from coachable.automata.limits import limits as proposed
    from coachable.automata.limits import with_limits
    from coachable.automata.trace_file import read_trace
    from coachable.behaviours.library import find_behaviour, load_behaviour
    from coachable.behaviours.text.document import read_document
    from coachable.behaviours.text.formatter import formatted
    from coachable.foundation.files import write_atomic

    if (trace is None) == (baseline is None):
        raise CoachableError("give a TRACE or --baseline, and not both: limits are measured from a motion")
    if trace is None and dt is not None:
        raise CoachableError("--dt is for a TRACE without times, and a baseline has its own; leave it out")
    if out is not None:
        require_suffix(out, (".behaviour",))
    file = find_behaviour(behaviour)
    require_no_input(out, file, *([] if trace is None else [trace]))
    described = load_behaviour(behaviour)
    if trace is not None:
        parts = read_trace(trace, described.signals, dt)
    else:
        from coachable.automata.trace import Trace
        from coachable.envs.baselines import baseline as walk

        steps = walk(str(baseline), plant=plant_of_baseline(plant), behaviour=described).trajectory
        parts = [Trace(steps.time, described.signals, steps.states)]
    found = proposed(described, parts, quantile, slack)
    if json:
        print_json({limit.phase: {"stays": limit.stays.tolist(), "limit": limit.seconds} for limit in found})
    else:
        width = max(len("phase"), *(len(limit.phase) for limit in found))
        print(f"{'phase':<{width}}  whole stays   median  longest    limit [s]")
        for limit in found:
            times = (*np.quantile(limit.stays, (0.5, 1)), limit.seconds) if len(limit.stays) else ()
            columns = "".join(f"{time:>9.3f}" for time in times) or "        –" * 3
            print(f"{limit.phase:<{width}}  {len(limit.stays):>11,}{columns}")
    if out is not None:
        text = with_limits(read_document(file), {limit.phase: limit.seconds for limit in found})
        write_atomic(out, formatted(text, str(out)))
        print(f"{out}: {described.name}", file=sys.stderr)
