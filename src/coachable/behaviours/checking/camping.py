"""Camping: the reward of a robot that enters a phase, stops, and waits.

Staying in a phase pays +1 a control step, and a step beyond its longest dwell time −1. An absence of one step
undoes no limit, and a longer one does.
"""

from __future__ import annotations

import math
from collections.abc import Iterator

from coachable.behaviours.behaviour import Behaviour, Phase
from coachable.behaviours.checking.boxes import apart, box_of
from coachable.behaviours.checking.findings import Finding, Proven, Result, Subject, Unknown
from coachable.behaviours.checking.solver import Witness, witness
from coachable.behaviours.predicates import All, Any, Comparison, Not, Predicate, holds
from coachable.behaviours.rewriting import widened


def camping(behaviour: Behaviour) -> Iterator[Result]:
    """Phases in which a standing robot is paid: all declared derivatives are zero, and it stays."""
    speeds = [signal.name for signal in behaviour.signals if signal.derivative_of is not None]
    if not speeds:
        yield Unknown(
            "whether a standing robot is paid: no signal is declared as the derivative of another, such as "
            "`dtheta = d/dt theta`"
        )
        return
    standing = All(*(Comparison(name, relation, 0) for name in speeds for relation in ("<=", ">=")))
    nowhere = True
    boxes = [box_of(phase.predicate) for phase in behaviour.phases]
    for index, phase in enumerate(behaviour.phases):
        # Once in a phase, its deadbands keep the robot there; without them, an earlier phase would count.
        before = zip(behaviour.phases[:index], boxes, strict=False)
        earlier: Predicate = Any(*(one.predicate for one, box in before if not apart(box, boxes[index])))
        stays = widened(phase.predicate)
        inside = All(phase.predicate, Not(earlier))
        match witness(behaviour.signal_names, standing, inside):
            case False if stays != inside.parts[0]:
                found = witness(behaviour.signal_names, standing, stays)
            case first:
                found = first
        match found:
            case False:
                continue
            case None:
                yield Unknown(f"whether a standing robot can stay in {phase.name}")
            case state:
                yield _camp(phase, speeds, state)
        nowhere = False
    if nowhere:
        yield Proven("nowhere to camp")


def _camp(phase: Phase, speeds: list[str], state: Witness) -> Finding:
    by_deadband = "" if holds(phase.predicate, state) else ", kept there by its deadband"
    message = f"A robot that stands still can stay in {phase.name}{by_deadband}"
    limit = math.inf if phase.dwell is None else phase.dwell.at_most
    subjects = (Subject("phase", phase.name),)
    if math.isfinite(limit):
        return Finding(
            "bounded-camping",
            "note",
            subjects,
            f"{message}. Its dwell time bounds the pay: +1 every step for at most {limit:g} s, then −1, "
            "until it has been outside for two steps.",
            f"Nothing, if {limit:g} s is not much longer than {phase.name} takes in a good movement.",
            state,
        )
    return Finding(
        "camping",
        "warning",
        subjects,
        f"{message} and is paid for it: +1 every step, for as long as the episode lasts. "
        "No movement earns more.",
        f"Limit how long {phase.name} may last, as in `for at most 0.5 s`; or require a speed in it that a "
        f"standing robot does not have: {' or '.join(speeds)}.",
        state,
    )
