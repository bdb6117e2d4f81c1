"""Counterexamples in Gymnasium environments as files, format_version 1; docs/counterexamples.md.

A file holds the disturbance. The environment and the policy are those of the run whose folder it lies in.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from contextlib import closing
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import Any

import numpy as np

from coachable.experiments.experiment import Lane, Which
from coachable.experiments.run_folder.reader import Run, open_run
from coachable.foundation.data import structure
from coachable.foundation.errors import RunFolderError
from coachable.verification.falsification.counterexample_file import (
    FORMAT_VERSION,
    read_counterexample,
    write_numbered,
)
from coachable.verification.falsification.episode_falls import EpisodeFalsification
from coachable.verification.robustness.disturbed_episode import EpisodeDisturbance, EpisodeEnd, EpisodeLoop


def write_episode_counterexamples(
    folder: Path, name: str, run: Run, lane: Lane, which: Which, results: Sequence[EpisodeFalsification]
) -> tuple[Path, ...]:
    """Write a lane's counterexamples into the folder `counterexamples`, in place of all older ones.

    **Arguments:** `folder`, the run's, or where its passports go; `name`, with which the files' names begin;
    `lane` and `which`, the policy of the run.

    **Returns:** where they are, NAME-1.json first; nothing is written where there are none.
    """
    about = {
        "lane": name,
        "environment": run.experiment.problem.robot,
        "setup": lane.setup,
        "seed": lane.seed,
        "which": which,
        "policy_sha256": run.policy_sha256(lane.setup, lane.seed, which),
    }
    files = [
        {
            "found_by": one.fall.found_by,
            "perturbation": {"kind": type(result.perturbation).__name__, **asdict(result.perturbation)},
            "size": one.size,
            "episode": result.episode,
            "seconds": result.seconds,
            "begin": one.disturbance.begin,
            "push": one.disturbance.push.tolist(),
            "kick": None if one.disturbance.kick is None else one.disturbance.kick.tolist(),
            "falls_after": {"search": one.fall.time, "anew": one.end.seconds},
        }
        for result in results
        for one in result.counterexamples
    ]
    numbered = [
        {"format_version": FORMAT_VERSION, **about, "number": number, **file}
        for number, file in enumerate(files, start=1)
    ]
    return write_numbered(folder, name, numbered)


@dataclass(frozen=True, eq=False)
class FallenEpisode:
    """A counterexample's file with the run that it is about."""

    run: Run
    lane: Lane
    which: Which
    number: int
    episode: int
    seconds: float
    """How long the episode was to last, at most."""
    disturbance: EpisodeDisturbance
    falls_after: float
    """[s]"""

    def again(self) -> EpisodeEnd:
        """The episode simulated once more, in an environment that is made anew."""
        loop = EpisodeLoop.of(self.run, self.lane.setup, self.lane.seed, self.which)
        with closing(loop.env):
            return loop.run(self.episode, self.disturbance, self.seconds)


def load_fallen_episode(path: Path) -> FallenEpisode:
    """The counterexample in a file `RUN/counterexamples/LANE-N.json`.

    **Raises:** `RunFolderError` if the file or its run is missing or damaged, and if the run's policy is not
    the one that fell.
    """
    data, damaged = read_counterexample(path), f"{path} is damaged, or no counterexample"
    file = structure(_File, data, damaged, RunFolderError)
    if len({len(row) for row in file.push}) > 1:
        raise RunFolderError(f"{damaged}: the rows of push are not of one length")
    run = open_run(path.resolve().parents[1])
    if run.policy_sha256(file.setup, file.seed, file.which) != file.policy_sha256:
        raise RunFolderError(
            f"{path} is about another policy than {run.path} has; verify the run again: coachable verify "
            f"{run.path} --setup {file.setup} --seed {file.seed} --level full"
        )
    return FallenEpisode(
        run=run,
        lane=Lane(file.setup, file.seed),
        which=file.which,
        number=file.number,
        episode=file.episode,
        seconds=file.seconds,
        disturbance=EpisodeDisturbance(
            begin=file.begin,
            push=np.array(file.push, float) if file.push else np.zeros((0, 0)),
            kick=None if file.kick is None else np.array(file.kick, float),
        ),
        falls_after=file.falls_after["anew"],
    )


@dataclass(frozen=True)
class _File:
    """What a counterexample's file holds; docs/counterexamples.md documents each key."""

    format_version: int
    lane: str
    number: int
    environment: str
    setup: str
    seed: int
    which: Which
    policy_sha256: str
    found_by: str
    perturbation: Mapping[str, Any]
    size: float
    episode: int
    seconds: float
    begin: int
    push: tuple[tuple[float, ...], ...]
    kick: tuple[float, ...] | None
    falls_after: Mapping[str, float]
