"""A hash of what a reward pays: two runs with equal hashes were paid alike."""

from __future__ import annotations

import hashlib
import json

from coachable.automata.latches import has_deadband
from coachable.behaviours.behaviour import Behaviour, Dwell
from coachable.behaviours.rewriting import normal_form
from coachable.rewards.forms import RewardForm, form_of
from coachable.rewards.setup import RewardSetup, Semantics


def reward_hash(
    behaviour: Behaviour, form: RewardForm | str, semantics: Semantics, setup: RewardSetup
) -> str:
    """SHA-256, in hexadecimal, of what the reward pays.

    It covers the phases' predicates in their normal form and order, deadbands included, their dwell times if
    there are any, the table of r_or or what else the form pays by, the semantics and the weights. Names of
    phases, titles, descriptions, units, phrases, the setup's name and the events on edges pay nothing and
    leave it unchanged. It is the same on every machine and in every run.
    """
    weights = [repr(weight + 0.0) for weight in setup.weights]
    return hash_of_paid(behaviour, form, semantics=semantics, weights=weights)


def hash_of_paid(behaviour: Behaviour, form: RewardForm | str, **also: object) -> str:
    """The same for a reward that is determined by its behaviour, its form and `also`."""
    paid: dict[str, object] = {
        **form_of(form).paid_by(behaviour),
        "phases": [str(normal_form(phase.predicate)) for phase in behaviour.phases],
        **also,
    }
    if form_of(form).judges_dwells and any(phase.dwell not in (None, Dwell()) for phase in behaviour.phases):
        paid["dwells"] = [_times(phase.dwell or Dwell()) for phase in behaviour.phases]
        if (flicker := form_of(form).flicker) != 0:
            paid["flicker"] = None if flicker is None else repr(float(flicker))
    if any(has_deadband(phase.predicate) for phase in behaviour.phases):
        # Once it was the whole phase that remembered, and paid otherwise.
        paid["deadbands"] = "of comparisons"
    return hashlib.sha256(json.dumps(paid, sort_keys=True, separators=(",", ":")).encode()).hexdigest()


def _times(dwell: Dwell) -> list[str]:
    return [repr(float(time) + 0.0) for time in (dwell.at_least, dwell.at_most)]
