"""Which training makes gaits that can be certified, and what it costs: runs beside each other, by walker.

    python -m bench.certifiable RUN [RUN …] --out docs/results/certifiable

Every RUN has its passports, from `coachable verify RUN --setup orthant --all`; those that were verified with
`--certify`, too, are drawn.
"""

from __future__ import annotations

import argparse
import csv
from collections.abc import Sequence
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import Any

import jax
import jax.numpy as jnp
import numpy as np
from matplotlib.figure import Figure

from coachable.analysis.intervals import estimate, mean
from coachable.analysis.measurements import measure
from coachable.experiments.experiment import Experiment
from coachable.experiments.run_folder.reader import open_run
from coachable.experiments.trainers.ppo import PPO
from coachable.foundation.style import FAINT, GOOD, HAIRLINE, INK, PAGE, STANCE, SWING, drawing, save
from coachable.learning.policy import Policy
from coachable.plants.compass import STATE_NAMES
from coachable.verification.gait.stability import without_bounds
from coachable.verification.passport.passport import Passport, read_passport

SETUP = "orthant"
_COLOURS = (FAINT, STANCE, SWING, GOOD)
_MARKS = {"proven": "o", "settles": "o", "does not settle": "X"}


@dataclass(frozen=True)
class Walker:
    """One seed of one training."""

    training: str
    seed: int
    distance: float
    """Of the evaluation after the last update [m]."""
    seconds_up: float
    """Of 100."""
    slope: float
    """Root mean square of ‖∂μ/∂s‖_F along that evaluation, μ the network's output before it is squashed."""
    clipped: float
    """Share of its torques that are cut at a bound."""
    num_steps: int
    """After which the gait repeats itself with the touchdown clock; 0 if it does not."""
    stable: bool
    largest: float
    """Largest |λ| of a step."""
    norm: float
    """‖DPᵏ‖₂."""
    proven: bool | None
    """`None` where no proof was tried."""
    radius: float

    @property
    def mark(self) -> str:
        """How it is drawn."""
        return "proven" if self.proven else "settles" if self.stable else "does not settle"


def walkers(path: Path) -> list[Walker]:
    """All seeds of a run's orthant setup."""
    run = open_run(path)
    runs, found = measure(run)[SETUP], []
    for seed, distance, seconds_up in zip(runs.seeds, runs.final_distance, runs.seconds_up, strict=True):
        passport = read_passport(path / "passports" / f"{SETUP}-{seed}.json")
        walked = run.trajectory(SETUP, int(seed))
        states = np.stack([walked[name] for name in STATE_NAMES], axis=1)[:-1]
        slope, clipped = _slope_and_clipping(run.policy(SETUP, int(seed)), states)
        found.append(
            Walker(
                training=trained(run.experiment),
                seed=int(seed),
                distance=float(distance),
                seconds_up=float(seconds_up),
                slope=slope,
                clipped=clipped,
                **_gait(passport),
            )
        )
    return found


def trained(experiment: Experiment) -> str:
    """What distinguishes a training, in words."""
    assert isinstance(experiment.trainer, PPO)
    config = experiment.trainer.config
    penalty = [f"penalty {config.jacobian_penalty:g}"] if config.jacobian_penalty else []
    tanh = ["tanh"] if config.squashing == "tanh" else []
    clock = experiment.require_plant("a certificate").clock
    return ", ".join([f"{clock} clock", *penalty, *tanh])


def markdown(every: Sequence[Sequence[Walker]]) -> str:
    """A row a training."""
    header = (
        *("training", "up", "k = 1", "k > 1", "stable", "proven", "radius, median (least … greatest)"),
        *("λ, median", "slope, median", "clipped [%]", "final distance [m]"),
    )
    rows = [header, ("---", *["---:"] * (len(header) - 1)), *(_row(some) for some in every)]
    return "\n".join("| " + " | ".join(row) + " |" for row in rows) + "\n"


def draw(every: Sequence[Sequence[Walker]], path: Path) -> None:
    """Distance over the policy's slope and over the gait's largest multiplier, a mark a walker.

    Of at most four trainings, the first in grey.
    """
    with drawing():
        figure = Figure(figsize=(7.16, 3.3), layout="constrained")
        left, right = figure.subplots(1, 2, sharey=True, width_ratios=(1.15, 1))
        beyond = 1.1
        for some, colour in zip(every, _COLOURS, strict=False):
            for one in some:
                filled = one.proven or not one.stable
                looks = {
                    "marker": _MARKS[one.mark],
                    "s": 30,
                    "facecolors": colour if filled else PAGE,
                    "edgecolors": PAGE if filled else colour,
                    "linewidths": 0.6 if filled else 1.2,
                }
                left.scatter(one.slope, one.distance, **looks)
                right.scatter(one.largest if one.stable else beyond, one.distance, **looks)
        right.axvspan(1.0, 1.2, color=HAIRLINE, lw=0, zorder=0)
        right.set(xlim=(0.1, 1.2), xticks=[0.2, 0.4, 0.6, 0.8, 1.0, beyond])
        right.set_xticklabels(["0.2", "0.4", "0.6", "0.8", "1", "no\nstable gait"])
        left.set(ylabel="distance of the final evaluation [m]", title="How steep the policy is")
        left.set_xlabel("slope ‖∂μ/∂s‖ along the walk [N m per rad and rad/s]")
        right.set(xlabel="largest multiplier |λ| of a step", title="How much its gait contracts")
        for axes in (left, right):
            axes.grid(axis="y")
        for some, colour in zip(every, _COLOURS, strict=False):
            settled, proven = sum(one.stable for one in some), sum(bool(one.proven) for one in some)
            label = f"{some[0].training}: {settled} of {len(some)} settle, {proven} proven"
            left.scatter([], [], marker="o", s=30, color=colour, label=label)
        left.scatter([], [], marker="o", s=30, facecolors=PAGE, edgecolors=INK, label="settles, not proven")
        left.scatter([], [], marker="X", s=30, color=INK, label="does not settle")
        figure.legend(loc="outside lower center", ncols=2)
    save(figure, path)


def main() -> None:
    """Compare the runs of the command line."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("runs", nargs="+", type=Path)
    parser.add_argument("--out", type=Path, required=True)
    arguments = parser.parse_args()
    every = [walkers(path) for path in arguments.runs]
    arguments.out.mkdir(parents=True, exist_ok=True)
    with open(arguments.out / "walkers.csv", "w", newline="", encoding="utf-8") as file:
        writer = csv.DictWriter(file, list(asdict(every[0][0])))
        writer.writeheader()
        for some in every:
            writer.writerows(map(_plain, some))
    (arguments.out / "walkers.md").write_text(markdown(every), encoding="utf-8")
    tried = [some for some in every if any(one.proven is not None for one in some)]
    for suffix in ("svg", "png"):
        draw(tried, arguments.out / f"certifiable.{suffix}")
    print(markdown(every), end="")


def _slope_and_clipping(policy: Policy, states: np.ndarray) -> tuple[float, float]:
    wanted = without_bounds(policy) if policy.squashing == "clip" else _unsquashed(policy)
    at = jnp.asarray(states)
    slopes = np.asarray(jax.vmap(jax.jacfwd(wanted))(at))
    slope = float(np.sqrt(np.mean(np.sum(np.square(slopes), axis=(1, 2)))))
    if policy.squashing != "clip":
        return slope, 0.0
    torque = np.asarray(jax.vmap(wanted)(at))
    beyond = (torque < np.asarray(policy.low)) | (torque > np.asarray(policy.high))
    return slope, float(beyond.mean())


def _unsquashed(policy: Policy) -> Policy:
    return without_bounds(
        Policy(policy.weights, policy.biases, policy.low, policy.high, activation=policy.activation)
    )


def _gait(passport: Passport) -> dict[str, Any]:
    assert passport.orbits is not None  # of a plant
    found, certificate, steps = passport.stability, passport.certificate, passport.orbits.touchdown.num_steps
    return {
        "num_steps": steps,
        "stable": found is not None and found.verdict == "stable",
        "largest": np.nan if found is None else found.largest ** (1 / steps),
        "norm": np.nan if found is None else found.norm,
        "proven": None if certificate is None else certificate.proven,
        "radius": 0.0 if certificate is None else certificate.radius,
    }


def _row(some: Sequence[Walker]) -> tuple[str, ...]:
    radii = sorted(one.radius for one in some if one.proven)
    tried = any(one.proven is not None for one in some)
    distance = estimate(mean, np.array([one.distance for one in some]))
    return (
        some[0].training,
        f"{sum(one.seconds_up >= 100 for one in some)} of {len(some)}",
        str(sum(one.num_steps == 1 for one in some)),
        str(sum(one.num_steps > 1 for one in some)),
        str(sum(one.stable for one in some)),
        str(sum(bool(one.proven) for one in some)) if tried else "not tried",
        f"{np.median(radii):.1e} ({radii[0]:.0e} … {radii[-1]:.0e})" if radii else "",
        f"{np.median([one.largest for one in some if one.stable]):.2f}",
        f"{np.median([one.slope for one in some]):.1f}",
        f"{100 * np.mean([one.clipped for one in some]):.0f}",
        f"{distance.value:.2f} [{distance.low:.2f}, {distance.high:.2f}]",
    )


def _plain(one: Walker) -> dict[str, object]:
    return {
        name: "" if value is None or value != value else f"{value:.5g}" if isinstance(value, float) else value
        for name, value in asdict(one).items()
    }


if __name__ == "__main__":
    main()
