"""What is verified: a lane's learned policy or a baseline, each as a closed loop."""

from __future__ import annotations

from dataclasses import dataclass

from coachable.behaviours.behaviour import Behaviour
from coachable.behaviours.library import load_behaviour
from coachable.envs.baselines import controller_of
from coachable.envs.problem import PlantProblem
from coachable.experiments.experiment import Lane, Which
from coachable.experiments.run_folder.reader import Run
from coachable.plants.event_search import PAPER_CHATTER, ChatterRule
from coachable.plants.plant import Controller, Plant
from coachable.plants.sampled import Clock
from coachable.rewards.setup import Semantics
from coachable.verification.gait.closed_loop import ClosedLoop
from coachable.verification.passport.passport import Walker
from coachable.verification.robustness.disturbed_episode import EpisodeLoop


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


@dataclass(frozen=True, eq=False)
class EpisodeSubject:
    """A lane of a run in a Gymnasium environment, whose physics can be stepped but not looked into."""

    walker: Walker
    run: Run
    lane: Lane
    which: Which

    @property
    def behaviour(self) -> Behaviour:
        """The run's."""
        return self.run.behaviour

    def loop(self) -> EpisodeLoop:
        """The closed loop, in an environment that is made anew."""
        return EpisodeLoop.of(self.run, self.lane.setup, self.lane.seed, self.which)


def lane_subject(run: Run, setup: str, seed: int, which: Which = "last") -> Subject | EpisodeSubject:
    """A lane of a run.

    **Raises:** `RunFolderError` if the run has no such lane, or its policy is missing or damaged.
    """
    problem, lane = run.experiment.problem, run.lane(setup, seed)
    policy = run.policy(setup, seed, which)
    plant = problem if isinstance(problem, PlantProblem) else None
    walker = Walker(
        name=lane.name if which == "last" else f"{lane.name}-{which}",
        setup=setup,
        seed=seed,
        which=which,
        policy_sha256=run.policy_sha256(setup, seed, which),
        semantics=None if plant is None else plant.semantics,
        clock="touchdown" if policy.clock == "touchdown" else "free",
        environment=problem.robot if plant is None else None,
    )
    if plant is None:
        return EpisodeSubject(walker, run, lane, which)
    return Subject(
        walker=walker,
        controller=policy,
        plant=plant.plant.under(plant.semantics),
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
