"""What is verified: a lane's learned policy or a baseline, each as a closed loop."""

from __future__ import annotations

from dataclasses import dataclass

from coachable.behaviours.behaviour import Behaviour
from coachable.behaviours.library import load_behaviour
from coachable.envs.baselines import controller_of
from coachable.experiments.run_folder.reader import Run, Which
from coachable.foundation.files import hash_of, read_bytes
from coachable.plants.event_search import PAPER_CHATTER, ChatterRule
from coachable.plants.named import plant_class
from coachable.plants.plant import Controller, Plant
from coachable.plants.sampled import Clock
from coachable.rewards.setup import Semantics
from coachable.verification.gait.closed_loop import ClosedLoop
from coachable.verification.passport.passport import Walker


@dataclass(frozen=True, eq=False)
class Subject:
    """A plant with the controller that drives it, and the behaviour that it is to follow."""

    walker: Walker
    controller: Controller
    plant: Plant
    behaviour: Behaviour

    @property
    def loop(self) -> ClosedLoop:
        """The closed loop, sampled and held as in training, in the numbers that the controller has."""
        released = self.walker.semantics == "released-code"
        return ClosedLoop(
            self.plant, self.controller, chatter=ChatterRule(None, 0.001) if released else PAPER_CHATTER
        )


def plant_of(run: Run) -> Plant:
    """The plant of a run, as the paper has it."""
    return plant_class("compass")(run.plan.plant)


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
        plant=plant_of(run).under(run.plan.semantics),
        behaviour=run.behaviour,
    )


def baseline_subject(
    name: str,
    plant: Plant,
    semantics: Semantics = "paper",
    clock: Clock = "free",
    behaviour: Behaviour | None = None,
) -> Subject:
    """One of a plant's written controllers, its control sampled and held.

    **Arguments:** `plant`, as the paper has it; `behaviour`, what it is to follow, by default its own
    under the semantics.

    **Raises:** `ParameterError` for an unknown controller, and for semantics that the plant does not have.
    """
    plant = plant.under(semantics)
    controller = controller_of(plant, name)
    return Subject(
        walker=Walker(name, None, None, None, None, semantics, clock),
        controller=controller,
        plant=plant,
        behaviour=behaviour or load_behaviour(plant.behaviour_under(semantics)),
    )
