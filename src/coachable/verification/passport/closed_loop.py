"""Who is to be verified: a lane's learned policy or a baseline, each as a closed loop."""

from __future__ import annotations

from dataclasses import dataclass

from coachable.behaviours.behaviour import Behaviour
from coachable.behaviours.library import load_behaviour
from coachable.envs.baselines import controller_of
from coachable.envs.walking_task import Clock
from coachable.experiments.plan import IMPLIED
from coachable.experiments.run_folder.reader import Run, Which
from coachable.foundation.files import hash_of, read_bytes
from coachable.plants.compass import PAPER_PARAMETERS, CompassParameters, CompassWalker
from coachable.plants.event_search import PAPER_CHATTER, ChatterRule
from coachable.rewards.setup import Semantics
from coachable.verification.gait.section import Controller, Loop
from coachable.verification.passport.passport import Walker


@dataclass(frozen=True, eq=False)
class Subject:
    """A walker with the controller that drives it, and what it was to follow."""

    walker: Walker
    controller: Controller
    plant: CompassWalker
    behaviour: Behaviour

    @property
    def loop(self) -> Loop:
        """The closed loop, sampled and held as in training, in the numbers that the controller has."""
        released = self.walker.semantics == "released-code"
        return Loop(
            self.plant, self.controller, chatter=ChatterRule(None, 0.001) if released else PAPER_CHATTER
        )


def lane_subject(run: Run, setup: str, seed: int, which: Which = "last") -> Subject:
    """A lane of a run.

    **Raises:** `RunFolderError` if the run has no such lane, or its policy is missing or damaged.
    """
    lane = run.lane(setup, seed).name
    policy = run.policy(setup, seed, which)
    return Subject(
        walker=Walker(
            name=lane if which == "last" else f"{lane}-{which}",
            setup=setup,
            seed=seed,
            which=which,
            policy_sha256=hash_of(read_bytes(run.path / "policies" / f"{lane}-{which}.safetensors")),
            semantics=run.plan.semantics,
            clock="touchdown" if policy.clock == "touchdown" else "free",
        ),
        controller=policy,
        plant=_plant(run.plan.plant, run.plan.semantics),
        behaviour=run.behaviour,
    )


def baseline_subject(
    name: str,
    semantics: Semantics = "paper",
    clock: Clock = "free",
    parameters: CompassParameters = PAPER_PARAMETERS,
    behaviour: Behaviour | None = None,
) -> Subject:
    """A baseline, its torque sampled and held; its behaviour by default the semantics' compass walking.

    **Raises:** `ParameterError` for an unknown controller.
    """
    plant = _plant(parameters, semantics)
    controller = controller_of(plant, name)
    return Subject(
        walker=Walker(name, None, None, None, None, semantics, clock),
        controller=controller,
        plant=plant,
        behaviour=behaviour or load_behaviour(IMPLIED[semantics]["behaviour"]),
    )


def _plant(parameters: CompassParameters, semantics: Semantics) -> CompassWalker:
    return CompassWalker(parameters, backward_passing_counts=semantics == "released-code")
