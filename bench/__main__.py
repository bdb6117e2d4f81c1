"""`make bench`: everything is measured in one run, in turns, and printed as one table."""

from __future__ import annotations

import argparse
import json
import os
import platform
import sys
import tempfile
from collections.abc import Mapping, Sequence
from dataclasses import asdict
from pathlib import Path
from typing import Any

from bench.child import Measurement, Program, measure
from bench.report import report
from bench.table import markdown
from coachable.experiments.layout import WIDEST_BATCH

LANES = (1, 4, 15, 60, 240)
VECTORS = (1, 256)

ONE_BLAS_THREAD = {
    "OPENBLAS_NUM_THREADS": "1",
    "OMP_NUM_THREADS": "1",
    # These force OpenBLAS to another processor's kernels; the roof is what this processor can do.
    "OPENBLAS_CORETYPE": None,
    "OPENBLAS_L2_SIZE": None,
}

ONE_XLA_THREAD = {
    # The size of XLA's thread pool. With more, a thread that finds nothing to do in a small program spins.
    "NPROC": "1",
}


def programs(cache: str, quick: bool) -> dict[str, Program]:
    """All that is measured, in the order in which it is; `quick` only shows that it runs."""
    shrink = 10 if quick else 1
    updates = 1 if quick else 5
    lanes = LANES[:2] if quick else LANES

    def program(module: str, repeats: int, variables: Mapping[str, str | None] = {}, **sizes: Any) -> Program:
        return Program(module, sizes, variables, min(repeats, 1) if quick else repeats)

    def sb3(flow: str, threads: int | None) -> Program:
        return program("sb3_training", 1, flow=flow, num_updates=updates, threads=threads)

    def classifier(library: str, calls: int) -> Program:
        return program("coachable_classifier", 3, num_states=100_000, library=library, calls=calls)

    def compilation() -> Program:
        return program("coachable_compilation", 0, {"XDG_CACHE_HOME": cache}, num_lanes=60)

    other_monitors = {
        "pyrewardmachines": program("reward_machine_monitor", 3, num_samples=30_000 // shrink),
        "rtamt, offline": program("rtamt_monitor", 1, num_samples=10_000 // shrink, online=False),
        "rtamt, online": program("rtamt_monitor", 1, num_samples=10_000 // shrink, online=True),
    }
    others = ("rtamt, online", "pyrewardmachines") if sys.version_info < (3, 13) else ()
    wrappers = ("coachable", "coachable, Perry's phases", "coachable, schedule", *others)
    return {
        "steps": program(
            "coachable_steps", 3, ONE_XLA_THREAD, num_lanes=WIDEST_BATCH, num_steps=50_000 // shrink
        ),
        "SciPy, matrices": program("scipy_steps", 3, flow="matrix", num_steps=5000 // shrink),
        "SciPy, floats": program("scipy_steps", 3, flow="scalar", num_steps=5000 // shrink),
        "monitor": program("coachable_monitor", 3, num_samples=1_000_000 // shrink, online=False),
        "monitor, one by one": program("coachable_monitor", 3, num_samples=30_000 // shrink, online=True),
        **(other_monitors if sys.version_info < (3, 13) else {}),
        "classifier, NumPy": classifier("numpy", 100 // shrink),
        "classifier, JAX": classifier("jax", 1000 // shrink),
        "update": program("coachable_update", 5, ONE_XLA_THREAD, num_lanes=8),
        **{f"vector {n}": program("vector_steps", 3, num_envs=n, num_steps=2000 // shrink) for n in VECTORS},
        "wrapper": program("wrapped_steps", 50, num_steps=500 // shrink, wrappers=wrappers),
        "wrapper in training": program("wrapped_training", 6),
        **{
            f"described {env}": program(
                "described_training", 3, ONE_XLA_THREAD, env=f"{env}-v5", num_updates=updates
            )
            for env in ("Walker2d", "Hopper", "HalfCheetah", "Ant", "Humanoid")
        },
        "sgemm 1024": program("sgemm", 5, ONE_BLAS_THREAD, size=1024, products=40 // shrink),
        "sgemm 64": program("sgemm", 5, ONE_BLAS_THREAD, size=64, products=50_000 // shrink),
        **{f"lanes {n}": program("coachable_training", 2, num_lanes=n, num_updates=updates) for n in lanes},
        "sb3, matrices, one thread": sb3("matrix", 1),
        "sb3, floats, one thread": sb3("scalar", 1),
        "sb3, matrices, as many threads as torch likes": sb3("matrix", None),
        "sbx": program("sbx_training", 1, num_updates=updates),
        # The first of these two fills the cache, the second reads it.
        "compilation, cold": compilation(),
        "compilation, cached": compilation(),
    }


def measure_in_turns(names: Sequence[str], rounds: int, quick: bool) -> dict[str, list[Measurement]]:
    """Every program once a round, so that a machine that slows down slows all of them down.

    **Arguments:** `names`, which programs, by what their names begin with; all of them if there are none.
    """
    measured: dict[str, list[Measurement]] = {}
    for turn in range(rounds):
        with tempfile.TemporaryDirectory() as cache:
            for name, program in programs(cache, quick).items():
                if names and not name.startswith(tuple(names)):
                    continue
                print(f"round {turn + 1} of {rounds}: {name}", file=sys.stderr, flush=True)
                for work, measurement in measure(program).items():
                    measured.setdefault(f"{name} {work}".rstrip(), []).append(measurement)
    return measured


def main() -> None:
    """Measure, print, and write JSON if asked to."""
    parser = argparse.ArgumentParser(prog="make bench ARGS='…'", description=__doc__)
    parser.add_argument("names", nargs="*", metavar="NAME", help="what the programs' names begin with")
    parser.add_argument("--rounds", type=int, default=3, help="how often everything is measured (default 3)")
    parser.add_argument("--quick", action="store_true", help="tiny sizes, to see that it runs")
    parser.add_argument("--json", type=Path, metavar="FILE", help="write every measurement there, too")
    arguments = parser.parse_args()
    known = list(programs("", arguments.quick))
    for name in arguments.names:
        if not any(each.startswith(name) for each in known):
            parser.error(f"no program's name begins with {name!r}; there are: {'; '.join(known)}")
    measured = measure_in_turns(arguments.names, arguments.rounds, arguments.quick)
    machine = f"{platform.machine()}, {os.cpu_count()} cores, Python {platform.python_version()}"
    print(f"{machine}; medians of {arguments.rounds} rounds\n\n{markdown(report(measured))}")
    if arguments.json:
        found = {name: [asdict(measurement) for measurement in turns] for name, turns in measured.items()}
        arguments.json.write_text(json.dumps(found, indent=1), encoding="utf-8")


if __name__ == "__main__":
    main()
