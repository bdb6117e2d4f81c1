"""Write models for other tools: export."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

from tyro.conf import Positional

from coachable.cli.options import (
    Clock,
    DeterministicRule,
    LaneSeed,
    LaneSetup,
    PlantOfBaseline,
    Trust,
    Which,
    WhichPolicy,
    option,
    output,
    plant_of_baseline,
    require_no_input,
    require_suffix,
    say_imports,
)
from coachable.foundation.errors import CoachableError

if TYPE_CHECKING:
    from coachable.envs.squashing import Deterministic
    from coachable.plants.plant import Plant
    from coachable.verification.export.model import Model


def export(
    run: Annotated[
        Positional[str | None],
        option(
            "RUN|BEHAVIOUR",
            "A run folder, or a behaviour: a shipped name or a file.",
            otherwise="the plant's behaviour",
        ),
    ] = None,
    *,
    out: Annotated[
        Path,
        output(
            "FILE",
            "x.onnx (the policy alone), x.kyx (KeYmaera X), x.xml (SpaceEx) or x.py (plain Python).",
        ),
    ],
    setup: LaneSetup = None,
    seed: LaneSeed = None,
    which: WhichPolicy = "last",
    deterministic: DeterministicRule = None,
    baseline: Annotated[
        str | None,
        option(
            "BASELINE",
            "What drives a behaviour's plant, such as virtual-gravity or virtual-gravity:slope=-0.05 "
            "(`coachable baseline` lists them).",
            otherwise="free inputs",
        ),
    ] = None,
    plant: PlantOfBaseline = None,
    clock: Annotated[
        Clock | None,
        option(
            "free|touchdown",
            "Whether a touchdown restarts the sample clock.",
            otherwise="the policy's, else free",
        ),
    ] = None,
    trust: Trust = False,
) -> None:
    """Write a policy for other programs, or a behaviour's automaton with the closed loop for other tools.

    ONNX holds a lane's policy, of a study or a training, and needs the [onnx] extra. The other files hold the
    plant with the behaviour's automaton. Of a run it is driven by a lane's policy, which the Python program
    holds; KeYmaera X and SpaceEx get its bounds. A behaviour is driven by a baseline, or by free inputs.

    For example:

        coachable export runs/paper --setup orthant --seed 3 -o policy.onnx
        coachable export runs/paper --setup orthant --seed 3 -o walker.py
        coachable export --baseline virtual-gravity -o walker.kyx
        coachable export compass-walking -o automaton.xml
    """
    suffix = require_suffix(out, (".onnx", *_WRITERS))
    from coachable.foundation.files import write_atomic

    if run is not None:
        require_no_input(out, Path(run))
        if Path(run).is_dir():
            say_imports(trust, run)
    if suffix == ".onnx":
        if baseline is not None or clock is not None:
            raise CoachableError(f"{out} holds a policy alone; leave out --baseline and --clock")
        _write_onnx(run, setup, seed, which, deterministic, out)
        return
    if run is not None and Path(run).is_dir():
        if baseline is not None:
            raise CoachableError("a run has policies of its own; leave out either the run or --baseline")
        model = _lane(Path(run), setup, seed, which, deterministic, clock)
    else:
        if deterministic is not None:
            raise CoachableError("--deterministic is about a run's policies; leave it out")
        if setup is not None or seed is not None:
            raise CoachableError(f"--setup and --seed name a lane of a run, but {run or 'no run'} is given")
        model = _behaviour(run, baseline, clock, plant_of_baseline(plant))
    write_atomic(out, _WRITERS[suffix](model))
    print(f"{out}: {model.name}")


def _write_onnx(
    path: str | None,
    setup: str | None,
    seed: int | None,
    which: Which,
    deterministic: Deterministic | None,
    out: Path,
) -> None:
    from coachable.experiments.run_folder.reader import open_run
    from coachable.foundation.files import write_atomic
    from coachable.learning.onnx_graph import onnx_bytes

    if path is None:
        raise CoachableError("which policy? Give a run folder: coachable export runs/paper -o policy.onnx")
    run = open_run(path)
    lane = run.lane(setup, seed)
    setup, seed = lane.setup, lane.seed
    write_atomic(out, onnx_bytes(run.policy(setup, seed, which, deterministic)))
    print(f"{out}: {which} policy of {run.lane(setup, seed).name}")


def _lane(
    path: Path,
    setup: str | None,
    seed: int | None,
    which: Which,
    deterministic: Deterministic | None,
    clock: Clock | None,
) -> Model:
    from coachable.experiments.run_folder.reader import open_run
    from coachable.verification.export.model import Model

    run = open_run(path)
    problem = run.experiment.require_plant("an automaton's export")
    if problem.semantics != "paper":
        raise CoachableError(
            f"{path} was trained by the rules of the released code, in which a foot that passes backward "
            "counts as a touchdown; exports state the paper's"
        )
    lane = run.lane(setup, seed)
    setup, seed = lane.setup, lane.seed
    policy = run.policy(setup, seed, which, deterministic)
    if policy.memory:
        raise CoachableError(
            f"{lane.name} observes its expected phase, too, and no model here has that memory; export it as "
            "ONNX, or a lane whose setup has observe = 'nothing' or 'value-only'"
        )
    name = f"{run.behaviour.name}, {which} policy of {run.lane(setup, seed).name}"
    return Model(name, run.behaviour, policy, problem.plant, clock or problem.clock)


def _behaviour(
    name: str | None,
    baseline: str | None,
    clock: Clock | None,
    plant: Plant,
) -> Model:
    from coachable.behaviours.library import load_behaviour
    from coachable.envs.baselines import controller_of
    from coachable.verification.export.model import Model

    behaviour = load_behaviour(name or plant.behaviour_under("paper"))
    if baseline is None:
        if clock is not None:
            raise CoachableError("free inputs are not sampled; give a --baseline, or leave out --clock")
        return Model(f"{behaviour.name}, free inputs", behaviour, None, plant)
    controller = controller_of(plant, baseline)
    return Model(f"{behaviour.name}, {baseline}", behaviour, controller, plant, clock or "free")


def _keymaerax(model: Model) -> str:
    from coachable.verification.export.keymaerax import keymaerax

    return keymaerax(model)


def _spaceex(model: Model) -> str:
    from coachable.verification.export.spaceex import spaceex

    return spaceex(model)


def _python(model: Model) -> str:
    from coachable.verification.export.python_script import python_script

    return python_script(model)


_WRITERS: Mapping[str, Callable[[Model], str]] = {".kyx": _keymaerax, ".xml": _spaceex, ".py": _python}
"""What writes each kind of file."""
