"""Look at walks: watch, record, gait, baseline."""

from __future__ import annotations

import math
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

from tyro.conf import Positional, arg

from coachable.cli.options import (
    BASELINE,
    BehaviourOfBaseline,
    DeterministicRule,
    Json,
    LaneSeed,
    LaneSetup,
    PlantOfBaseline,
    RunFolder,
    Semantics,
    SemanticsOfBaseline,
    Trust,
    Which,
    WhichPolicy,
    is_baseline,
    option,
    output,
    plant_of_baseline,
    print_json,
    refuse_out_with_json,
    require_folder,
    require_no_input,
    say_imports,
)
from coachable.foundation.data import real_number, whole_number
from coachable.foundation.errors import PlanError

if TYPE_CHECKING:
    from coachable.behaviours.behaviour import Behaviour
    from coachable.envs.baselines import BaselineReport
    from coachable.experiments.recorded_episodes import Around
    from coachable.experiments.run_folder.reader import Run
    from coachable.plants.plant import Plant


def watch(
    run: Annotated[
        Positional[str],
        arg(metavar="RUN|BASELINE|FILE", help=f"A run folder, a counterexample's file, or {BASELINE}."),
    ],
    out: Annotated[
        Path, output("FILE", "A film, x.gif or x.mp4 (needs the [video] extra), or x.png, x.svg, x.pdf.")
    ],
    setup: LaneSetup = None,
    seed: Annotated[
        tuple[int, ...] | None,
        option("N [N …]", "The lane's seed; several walk side by side.", otherwise="the plan's first"),
    ] = None,
    which: WhichPolicy = "last",
    deterministic: DeterministicRule = None,
    seconds: Annotated[float, arg(help="How much of the walk.")] = 10.0,
    plant: PlantOfBaseline = None,
    behaviour: BehaviourOfBaseline = None,
    semantics: SemanticsOfBaseline = "paper",
    trust: Trust = False,
) -> None:
    """Draw a walk: the robot on the ground, its phase in colour.

    For example:

        coachable watch runs/paper --setup orthant --seed 3 -o gait.gif
        coachable watch runs/paper --setup sparse --seed 1 2 3 --which best -o gaits.mp4
        coachable watch runs/paper --setup sparse -o gait.png
        coachable watch virtual-gravity:slope=-0.05 -o gait.gif
        coachable watch runs/walker2d --setup described --seed 0 1 -o walker2d.gif
        coachable watch runs/paper/counterexamples/orthant-3-1.json -o fall.gif
    """
    from coachable.viewing.watch import draw_motions, require_drawable

    require_drawable(out)
    require_no_input(out, Path(run))
    real_number(seconds, "seconds", PlanError, above=0, most=3600)
    from coachable.experiments.walks import walk_of_baseline, walk_of_lane

    robot = plant_of_baseline(plant)
    of_baseline = is_baseline(run, robot)
    if (of_baseline or run.endswith(".json")) and (setup is not None or seed is not None):
        raise PlanError(f"--setup and --seed name a lane of a run, but {run} is given; leave them out")
    if (of_baseline or run.endswith(".json")) and deterministic is not None:
        raise PlanError(f"--deterministic is about a run's policies, but {run} is given; leave it out")
    if not of_baseline:
        say_imports(trust, run)
    if of_baseline:
        walks = [walk_of_baseline(run, semantics, seconds, robot, _described(behaviour))]
        who = walks[0].title
    elif run.endswith(".json"):
        from coachable.verification.falsification.counterexample_file import (
            load_counterexample,
            read_counterexample,
        )

        if "environment" in read_counterexample(Path(run)):
            _draw_fall(Path(run), seconds, out)
            return
        walks = [load_counterexample(Path(run))]
        who = walks[0].title
    else:
        from coachable.experiments.run_folder.reader import open_run

        opened = open_run(run)
        setup = opened.experiment.setups[0].name if setup is None else setup
        seeds = dict.fromkeys(seed or (opened.experiment.first_seed,))
        if not opened.experiment.problem.in_jax:
            if deterministic is not None:
                raise PlanError("--deterministic: of a Gymnasium robot its evaluation episodes are drawn")
            _draw_robot(opened, setup, [*seeds], which, seconds, out)
            who = f"{setup}, seed {', '.join(map(str, seeds))}, {which} policy"
            print(f"{out}: {opened.experiment.problem.robot}, {who}")
            return
        walks = [walk_of_lane(opened, setup, number, which, seconds, deterministic) for number in seeds]
        who = f"{setup}, seed{'s' * (len(walks) > 1)} {', '.join(map(str, seeds))}, {which} policy"
    titles = [walk.title if len(walks) > 1 else "" for walk in walks]
    motions = {title: walk.motion for title, walk in zip(titles, walks, strict=True)}
    draw_motions(motions, out, walks[0].behaviour.phases)
    print(f"{out}: {who}")


def _draw_fall(path: Path, seconds: float, out: Path) -> None:
    """A counterexample in a Gymnasium environment, simulated anew."""
    from coachable.verification.falsification.episode_counterexample import load_fallen_episode
    from coachable.verification.robustness.disturbed_episode import DisturbedEnv

    fallen = load_fallen_episode(path)
    lane, seconds = fallen.lane, min(seconds, fallen.seconds)
    _draw_robot(
        fallen.run,
        lane.setup,
        [lane.seed],
        fallen.which,
        seconds,
        out,
        episode=fallen.episode,
        around=lambda env: DisturbedEnv(env, fallen.disturbance),
    )
    print(f"{out}: {lane.name}, counterexample {fallen.number}; it falls after {fallen.falls_after:.2f} s")


def _draw_robot(
    run: Run,
    setup: str,
    seeds: list[int],
    which: Which,
    seconds: float,
    out: Path,
    *,
    episode: int = 0,
    around: Around = lambda env: env,
) -> None:
    """A film, or a strobe picture of the end; only MuJoCo's robots are not drawn by their environment."""
    from coachable.experiments.recorded_episodes import has_limbs, recorded_walk, rendered_walk
    from coachable.foundation.style import save
    from coachable.viewing.rendered import draw_rendered
    from coachable.viewing.robot_strobe import robot_strobe
    from coachable.viewing.side_view import SideView
    from coachable.viewing.watch import PICTURES

    is_picture = out.suffix.lower() in PICTURES
    if not has_limbs(run):
        if is_picture:
            raise PlanError(
                f"{run.experiment.problem.robot} can only be drawn by itself, in a film: .gif or .mp4"
            )
        drawn = [rendered_walk(run, setup, number, which, seconds, episode, around) for number in seeds]
        draw_rendered(drawn, out, run.behaviour.phases)
        return
    views = [
        SideView.of(recorded_walk(run, setup, number, which, episode, seconds, around)) for number in seeds
    ]
    if is_picture:
        save(robot_strobe(views), out)
    else:
        draw_rendered(views, out, run.behaviour.phases)


def record(
    run: RunFolder,
    out: Annotated[Path, output("FILE", "x.csv, x.csv.gz or x.parquet.")],
    setup: LaneSetup = None,
    seed: LaneSeed = None,
    which: WhichPolicy = "last",
    episode: Annotated[int, arg(metavar="N", help="Which of its evaluation episodes.")] = 0,
    trust: Trust = False,
) -> None:
    """Record a trained robot's signals while it moves: a column each, for `coachable explain`.

    Of a plant of coachable, episode 0 is the evaluation episode in RUN; the others begin near its start.

    For example:

        coachable record runs/walker2d --setup both --seed 0 -o walk.csv
        coachable record runs/paper --setup orthant --seed 3 --which best -o walk.parquet
        coachable explain mine.behaviour walk.csv
    """
    from coachable.automata.trace_file import require_trace_file, write_trace
    from coachable.experiments.recorded_episodes import recorded_walk
    from coachable.experiments.run_folder.reader import Run

    whole_number(episode, "the episode, counted from 0,", PlanError, 0, 10**6)
    require_trace_file(out)
    require_no_input(out, run)
    say_imports(trust, run)
    opened = Run.open(run)
    setup = opened.experiment.setups[0].name if setup is None else setup
    seed = opened.experiment.first_seed if seed is None else seed
    walk = recorded_walk(opened, setup, seed, which, episode)
    write_trace(out, walk.trace)
    end = "it fell" if walk.fell else "it did not fall"
    print(f"{out}: {walk.title}, {len(walk.time):,} samples in {walk.time[-1]:.3f} s; {end}")


def gait(
    run: RunFolder,
    episodes: Annotated[int, arg(metavar="N", help="Episodes a lane, each from another start.")] = 10,
    which: WhichPolicy = "last",
    speed: Annotated[float, arg(metavar="V", help="For how soon it was reached [m/s].")] = 1.0,
    out: Annotated[
        Path | None, output("DIR", "Where the table and the diagram go.", otherwise="the run folder")
    ] = None,
    json: Json = False,
    trust: Trust = False,
) -> None:
    """Measure which gaits came out of a training: do they walk, run, gallop, or hop on one foot?

    Prints a table with intervals, and writes it with a footfall diagram. Every episode's numbers go into
    gaits.parquet in the run folder, with --json too.

    For example:

        coachable gait runs/walker2d
        coachable gait runs/paper
        coachable gait runs/walker2d --episodes 20 --speed 1.5 -o results/walker2d
        coachable gait runs/walker2d --json
    """
    from coachable.analysis.gait_table import print_gaits
    from coachable.cli.progress import walkers_progress
    from coachable.experiments.run_folder.reader import Run
    from coachable.foundation.style import save
    from coachable.gaits.survey import survey
    from coachable.viewing.footfalls import footfalls

    whole_number(episodes, "episodes", PlanError, 1, 10**5)
    real_number(speed, "speed", PlanError)
    if json:
        refuse_out_with_json(out)
    require_folder(out)
    say_imports(trust, run)
    opened = Run.open(run)
    with walkers_progress("gait", len(opened.lanes)) as advance:
        surveyed = survey(opened, episodes, which, advance)
    if json:
        from coachable.analysis.numbers import gait_numbers

        print_json(gait_numbers(opened, speed) | {"not_measured": surveyed.absent})
        return
    print_gaits(opened, speed, out or run)
    for sentence in surveyed.absent:
        print(f"not measured: {sentence}")
    if not surveyed.footfalls:
        return
    picture = footfalls(surveyed.footfalls)
    for suffix in ("svg", "png"):
        path = (out or run) / f"footfalls.{suffix}"
        save(picture, path)
        print(f"wrote {path}")


def baseline(
    name: Annotated[
        Positional[str | None],
        option(
            "[BASELINE]",
            "One of the plant's written controllers, with its settings behind it: NAME:SETTING=NUMBER.",
            otherwise="the plant's first",
        ),
    ] = None,
    plant: PlantOfBaseline = None,
    behaviour: BehaviourOfBaseline = None,
    semantics: Annotated[
        Semantics, arg(help="What the paper means, or what its code does, quirks included.")
    ] = "paper",
    json: Json = False,
) -> None:
    """Walk a baseline of a plant for ten seconds, in float64, and print how it does.

    Lists the plant's baselines with the settings that each has. For example:

        coachable baseline
        coachable baseline virtual-gravity:slope=-0.05
        coachable baseline constant-torque:torque=-1.3,-0.2 --json
        coachable baseline --plant mine:Robot --behaviour mine.behaviour
        coachable baseline --semantics released-code
    """
    from coachable.envs.baselines import baseline as walk
    from coachable.envs.baselines import controller_of
    from coachable.plants.controllers import settings_of

    robot = plant_of_baseline(plant)
    name = name or next(iter(robot.controllers()))
    settings = settings_of(controller_of(robot.under(semantics), name))
    report = walk(name, semantics, plant=robot, behaviour=_described(behaviour))
    if not json:
        _print_baseline(report, robot)
        return
    numbers = {
        "baseline": report.controller,
        "settings": settings,
        "plant": robot.name,
        "semantics": semantics,
        "hip_x": report.hip_x,
        "foot_x": report.foot_x,
        "touchdowns": report.touchdowns,
        "period": report.period,
        "step_length": report.step_length,
        "speed": report.speed,
        "share_in_cycle": report.share_in_cycle,
        "fell": report.fell,
        "rewards": dict(report.rewards),
    }
    print_json(numbers)


def _print_baseline(report: BaselineReport, plant: Plant) -> None:
    from coachable.plants.controllers import description_of, settings_of

    fell = ": it fell" if report.fell else ""
    print(f"{report.controller} of {plant.name}, {report.semantics} semantics, 10 s{fell}")
    for what, value, digits, unit in (
        ("distance of the base", report.hip_x, 4, "m"),
        ("distance of the foot", report.foot_x, 4, "m"),
        ("touchdowns", report.touchdowns, 0, ""),
        ("period", report.period, 4, "s"),
        ("step length", report.step_length, 4, "m"),
        ("speed", report.speed, 3, "m/s"),
        ("in the cycle", 100 * report.share_in_cycle, 1, "% of samples"),
        *((f"reward, {name}", reward, 3, "") for name, reward in report.rewards.items()),
    ):
        number = f"{value:>10.{digits}f} {unit}" if math.isfinite(value) else f"{'–':>10}"
        print(f"  {what:<24}{number}".rstrip())
    print(f"\nBaselines of {plant.name}, with their settings:")
    for name, controller in plant.under(report.semantics).controllers().items():
        settings = "".join(f":{key}={_numbers(value)}" for key, value in settings_of(controller).items())
        print(f"  {name}{settings}\n      {description_of(controller)}".rstrip())


def _numbers(value: float | tuple[float, ...]) -> str:
    return ",".join(f"{number:g}" for number in (value if isinstance(value, tuple) else (value,)))


def _described(behaviour: str | None) -> Behaviour | None:
    """The behaviour of a name or a file, if one is given."""
    from coachable.behaviours.library import load_behaviour

    return None if behaviour is None else load_behaviour(behaviour)
