"""Many runs: what a study is, how it is run and resumed, and the folder it leaves behind."""

from coachable.experiments.api import rollout, train
from coachable.experiments.experiment import Experiment, Lane
from coachable.experiments.plan import load_plan, shipped_plans
from coachable.experiments.run_folder.reader import Run, open_run
from coachable.experiments.trainers.trainer import Trainer

__all__ = [
    "Experiment",
    "Lane",
    "Run",
    "Trainer",
    "load_plan",
    "open_run",
    "rollout",
    "shipped_plans",
    "train",
]
