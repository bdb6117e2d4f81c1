"""Time each program in a fresh interpreter: none sees the memory, threads or settings of another."""

from __future__ import annotations

import json
import os
import subprocess
import sys
from collections.abc import Mapping
from dataclasses import dataclass
from importlib import import_module
from statistics import median
from typing import Any

from bench.cost import Cost, peak_megabytes, timed


@dataclass(frozen=True)
class Program:
    """A module of bench/programs with its sizes; environment variables to set or, with None, to unset.

    Its `prepare` gives a work and the units it does, or several works by name, to be done in turns.
    """

    module: str
    sizes: Mapping[str, Any]
    variables: Mapping[str, str | None]
    repeats: int


@dataclass(frozen=True)
class Measurement:
    """One process's timings of one program: its first call, and the median of those after it, if any."""

    units: float
    """What one call does: steps, or floating-point operations."""
    first: Cost
    usual: Cost
    megabytes: float

    @property
    def rate(self) -> float:
        """Units per CPU-second."""
        return self.units / self.usual.cpu

    @property
    def wall_rate(self) -> float:
        """Units per second on the wall."""
        return self.units / self.usual.wall


def measure(program: Program) -> dict[str, Measurement]:
    """Run a program in a child process and read what it reports of its works; a single one has no name."""
    variables = {**os.environ, **program.variables}
    done = subprocess.run(
        [
            sys.executable,
            "-m",
            "bench.child",
            program.module,
            json.dumps(program.sizes),
            str(program.repeats),
        ],
        env={name: value for name, value in variables.items() if value is not None},
        stdin=subprocess.DEVNULL,
        stdout=subprocess.PIPE,
        text=True,
        check=True,
    )
    report = json.loads(done.stdout.splitlines()[-1])
    return {
        name: Measurement(report["units"], Cost(*first), Cost(*usual), report["megabytes"])
        for name, (first, usual) in report["works"].items()
    }


def main(module: str, sizes: str, repeats: str) -> None:
    """The child's side of `measure`."""
    works, units = import_module(f"bench.programs.{module}").prepare(**json.loads(sizes))
    works = works if isinstance(works, Mapping) else {"": works}
    first = {name: timed(work) for name, work in works.items()}
    turns = [{name: timed(work) for name, work in works.items()} for _ in range(int(repeats))] or [first]
    report = {
        "units": units,
        "works": {
            name: [
                (cost.cpu, cost.wall),
                (median(turn[name].cpu for turn in turns), median(turn[name].wall for turn in turns)),
            ]
            for name, cost in first.items()
        },
        "megabytes": peak_megabytes(),
    }
    print(json.dumps(report))


if __name__ == "__main__":
    main(*sys.argv[1:])
