"""Many runs: what a study is, how it is run and resumed, and the folder it leaves behind."""

from typing import TYPE_CHECKING

from coachable.foundation.lazy import lazily

if TYPE_CHECKING:
    from coachable.experiments.api import rollout as rollout
    from coachable.experiments.api import train as train
    from coachable.experiments.experiment import Experiment as Experiment
    from coachable.experiments.experiment import Lane as Lane
    from coachable.experiments.plan import load_plan as load_plan
    from coachable.experiments.plan import shipped_plans as shipped_plans
    from coachable.experiments.run_folder.reader import Run as Run
    from coachable.experiments.run_folder.reader import open_run as open_run
    from coachable.experiments.trainers.trainer import Trainer as Trainer

_HOMES = {
    "Experiment": "experiments.experiment",
    "Lane": "experiments.experiment",
    "Run": "experiments.run_folder.reader",
    "Trainer": "experiments.trainers.trainer",
    "load_plan": "experiments.plan",
    "open_run": "experiments.run_folder.reader",
    "rollout": "experiments.api",
    "shipped_plans": "experiments.plan",
    "train": "experiments.api",
}

__all__ = sorted(_HOMES)  # pyright: ignore[reportUnsupportedDunderAll]
__getattr__, __dir__ = lazily(__name__, _HOMES)
