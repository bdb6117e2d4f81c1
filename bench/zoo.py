"""What came out where robots were told to walk, run, hop, …: a table of runs, a row for each setup of each.

    python -m bench.zoo runs/zoo/walker2d-walk runs/zoo/walker2d-run --out docs/results/zoo

Of runs whose gaits were measured (`coachable gait RUN`). Every policy also walks from perturbed starts, which
takes a minute for twenty of them.
"""

from __future__ import annotations

import argparse
from collections.abc import Sequence
from contextlib import closing
from dataclasses import replace
from pathlib import Path

import numpy as np

from coachable.analysis.gait_table import MEASURES, cell, over_seeds, usual_gaits
from coachable.analysis.intervals import Estimate, estimate, mean
from coachable.envs.problem import EnvironmentProblem, bare_environment
from coachable.experiments.assessment import assessment
from coachable.experiments.run_folder.reader import Run, open_run

SHOWN = ("cycles", "follows", "alternation", "step_asymmetry", "speed", "transport", "fell")
"""What is shown of the gaits, of `MEASURES`."""

ONCE_A_SECOND = 1.0
"""A seed goes round if it completes so many cycles a second, on average over its episodes [1/s]."""

PERTURBED = 0.1
"""Every angle [rad], height [m] and speed [rad/s, m/s] of a perturbed start is drawn within ± this;
Gymnasium's own starts of Walker2d and Hopper are drawn within ± 0.005."""

HEADER = (
    "robot",
    "told to",
    "setup",
    "up to the end",
    "and round",
    "gaits of the seeds",
    *(MEASURES[name][0] for name in SHOWN),
    f"fell from starts perturbed by {PERTURBED} [%]",
    "first round and up after [k steps]",
)

NOTE = (
    "Ten deterministic episodes a seed from starts that training never saw, by the policy after the "
    "last update. Up to the end: seeds of which no episode fell. And round: of those, the ones that "
    "complete a whole cycle of the description a second or more. First round and up: the first "
    "evaluation in which a seed did both, a mean over the seeds that ever did. Fell from perturbed starts: "
    "of ten more episodes a seed, whose starts differ from the robot's home by so many rad, m, rad/s and m/s "
    "at most; – where its own starts differ as much. Means over seeds with 95 % bootstrap intervals."
)


def rows(run: Run) -> list[tuple[str, ...]]:
    """A row for each setup of a run."""
    plan, gaits = run.experiment, run.columns("gaits")
    found = []
    for setup in plan.setups:
        mine = [gaits["lane"] == run.lane(setup.name, seed).name for seed in plan.seeds]
        up = [not gaits["fell"][each].any() for each in mine]
        cycles = np.nan_to_num(gaits["cycles"].astype(float))
        rounds = [one and cycles[each].mean() >= ONCE_A_SECOND for one, each in zip(up, mine, strict=True)]
        first = [steps for seed in plan.seeds if (steps := _first_round(run, setup.name, seed))]
        found.append(
            (
                plan.problem.robot,
                run.behaviour.name,
                setup.name,
                f"{sum(up)} of {len(mine)}",
                f"{sum(rounds)} of {len(mine)}",
                usual_gaits(run, gaits, setup.name),
                *(cell(over_seeds(run, gaits, setup.name, name), MEASURES[name][1]) for name in SHOWN),
                cell(fell_from_perturbed_starts(run, setup.name), 100),
                f"{cell(estimate(mean, np.array(first, float)), 1e-3)}, {len(first)} seeds"
                if first
                else "never",
            )
        )
    return found


def fell_from_perturbed_starts(run: Run, setup: str) -> Estimate:
    """The share of episodes that fall, over seeds; NaN where the robot's own starts are drawn as widely."""
    plan = run.experiment
    problem = plan.problem
    assert isinstance(problem, EnvironmentProblem)
    with closing(bare_environment(problem.env, problem.env_options)) as env:
        if getattr(env.unwrapped, "_reset_noise_scale", PERTURBED) >= PERTURBED:
            return Estimate(np.nan)
    options = {**problem.env_options, "reset_noise_scale": PERTURBED}
    perturbed = replace(plan, problem=replace(problem, env_options=options), evaluation_episodes=10)
    fell = [
        assessment(perturbed, run.lane(setup, seed)).evaluate(run.policy(setup, seed))["fell"].mean()
        for seed in plan.seeds
    ]
    return estimate(mean, np.array(fell))


def markdown(found: Sequence[Sequence[str]]) -> str:
    """The table, and what its columns mean."""
    lines = [HEADER, ("---",) * len(HEADER), *found]
    return "\n".join("| " + " | ".join(line) + " |" for line in lines) + f"\n\n{NOTE}\n"


def _first_round(run: Run, setup: str, seed: int) -> int | None:
    """Training steps of the first evaluation in which no episode fell and cycles came once a second."""
    gaits, evaluations = run.columns("gaits"), run.columns("evaluations")
    dt, mine = float(gaits["dt"][0]), evaluations["lane"] == run.lane(setup, seed).name
    for step in np.unique(evaluations["step"][mine]):
        here = mine & (evaluations["step"] == step)
        seconds = evaluations["length"][here].sum() * dt
        if (
            not evaluations["fell"][here].any()
            and evaluations["cycles"][here].sum() >= ONCE_A_SECOND * seconds
        ):
            return int(step)
    return None


def main() -> None:
    """Write the table of the runs of the command line."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("runs", nargs="+", type=Path)
    parser.add_argument("--out", type=Path, required=True)
    arguments = parser.parse_args()
    text = markdown([row for path in arguments.runs for row in rows(open_run(path))])
    arguments.out.mkdir(parents=True, exist_ok=True)
    (arguments.out / "zoo.md").write_text(text, encoding="utf-8")
    print(text, end="")


if __name__ == "__main__":
    main()
