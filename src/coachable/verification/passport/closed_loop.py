"""What is verified: a lane's learned policy or a baseline, each as a closed loop."""

from __future__ import annotations

from dataclasses import dataclass

from coachable.behaviours.behaviour import Behaviour
from coachable.behaviours.library import load_behaviour
from coachable.envs.baselines import controller_of
from coachable.envs.problem import PlantProblem
from coachable.envs.squashing import Deterministic
from coachable.experiments.experiment import Lane, Which
from coachable.experiments.run_folder.reader import Run
from coachable.foundation.errors import ParameterError
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


def lane_subject(
    run: Run, setup: str, seed: int, which: Which = "last", deterministic: Deterministic | None = None
) -> Subject | EpisodeSubject:
    """A lane of a run.

    **Arguments:** `deterministic`, what the policy does when it does not explore, by default as it was kept.

    **Raises:** `RunFolderError` if the run has no such lane, or its policy is missing or damaged;
    `ParameterError` for a policy with a memory in `released-code` semantics.
    """
    problem, lane = run.experiment.problem, run.lane(setup, seed)
    policy = run.policy(setup, seed, which, deterministic)
    plant = problem if isinstance(problem, PlantProblem) else None
    if plant is not None and policy.memory and plant.semantics != "paper":
        raise ParameterError(
            f"{lane.name} observes its expected phase, too, and in {plant.semantics} semantics what is "
            "remembered outlives an episode: there is no closed loop that a passport could be about"
        )
    kept = deterministic in (None, run.experiment.deterministic[0])
    other_rule = [] if kept else [policy.deterministic]
    walker = Walker(
        name="-".join([lane.name, *([which] if which != "last" else []), *other_rule]),
        setup=setup,
        seed=seed,
        which=which,
        policy_sha256=run.policy_sha256(setup, seed, which),
        semantics=None if plant is None else plant.semantics,
        clock="touchdown" if policy.clock == "touchdown" else "free",
        environment=problem.robot if plant is None else None,
        deterministic=policy.deterministic,
        memory=() if plant is None else policy.observation_names[len(plant.plant.state_names) :],
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
