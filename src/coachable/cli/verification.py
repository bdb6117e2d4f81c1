"""Ask whether a walker really walks: verify."""

from __future__ import annotations

import sys
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Literal

from tyro.conf import Positional, arg

from coachable.cli.options import (
    BASELINE,
    BehaviourOfBaseline,
    Clock,
    DeterministicRule,
    LaneSeed,
    LaneSetup,
    PlantOfBaseline,
    SemanticsOfBaseline,
    Trust,
    Which,
    WhichPolicy,
    is_baseline,
    option,
    output,
    plant_of_baseline,
    print_json,
    require_folder,
    say_imports,
)
from coachable.foundation.errors import CoachableError

if TYPE_CHECKING:
    from coachable.envs.squashing import Deterministic
    from coachable.verification.passport.closed_loop import EpisodeSubject, Subject
    from coachable.verification.passport.passport import Passport


def verify(
    run: Annotated[
        Positional[str | None],
        arg(
            metavar="RUN|BASELINE",
            help=f"A run folder, or {BASELINE}.",
            help_behavior_hint="",
        ),
    ] = None,
    setup: LaneSetup = None,
    seed: LaneSeed = None,
    all: Annotated[
        bool, arg(help="Every lane, or with --setup every seed of it; goes on where it was stopped.")
    ] = False,
    level: Annotated[
        Literal["quick", "full"],
        arg(
            help="Adherence, orbit, stability and 1,000 starts; or 100,000 starts with pictures, pushes and "
            "a search for falls, too, which needs the [verify] extra. In a Gymnasium environment: adherence; "
            "or pushes and the search, too."
        ),
    ] = "quick",
    which: WhichPolicy = "last",
    deterministic: DeterministicRule = None,
    baseline: Annotated[
        str | None,
        option(
            "BASELINE",
            "What stands beside the walker in the table of pushes.",
            otherwise="the plant's first",
        ),
    ] = None,
    plant: PlantOfBaseline = None,
    behaviour: BehaviourOfBaseline = None,
    semantics: SemanticsOfBaseline = "paper",
    clock: Annotated[Clock, arg(help="Of a baseline; a policy has its own.")] = "free",
    certify: Annotated[
        bool,
        arg(
            help="Try to prove, for five minutes a walker at most, that a box around the gait returns into "
            "itself; needs the [verify] extra."
        ),
    ] = False,
    recheck: Annotated[
        Path | None,
        option("FILE", "Prove a certificate's file anew, by the checker alone, and do nothing else."),
    ] = None,
    out: Annotated[
        Path | None,
        output("DIR", "Where passports are written.", otherwise="RUN/passports; a baseline's nowhere"),
    ] = None,
    json: Annotated[
        bool, arg(help="Print JSON, whose fields are in docs/passport.md; passports are written as ever.")
    ] = False,
    trust: Trust = False,
) -> None:
    """Give a walker its gait passport: does it follow, repeat itself, return, and from how far?

    A passport is a measurement, not a proof; docs/passport.md tells what each line means and does not mean,
    and docs/certificate.md what a certificate proves and does not prove. For example:

        coachable verify runs/paper --setup orthant --seed 3
        coachable verify runs/paper --setup orthant --seed 3 --level full
        coachable verify runs/paper --all
        coachable verify runs/walker2d --setup both --seed 0 --level full
        coachable verify virtual-gravity --level full
        coachable verify runs/paper --setup orthant --all --certify
        coachable verify --recheck runs/paper/certificates/orthant-1.json
    """
    if recheck is not None:
        if run is not None:
            raise CoachableError(f"--recheck proves a file by itself; leave out {run}")
        _recheck(recheck, as_json=json)
        return
    if run is None:
        raise CoachableError(
            "which walker? Give a run folder or a baseline: coachable verify runs/paper --all"
        )
    from coachable.experiments.runner import set_up_jax

    if all and seed is not None:
        raise CoachableError("--all means every seed; leave out --seed, or --all")
    require_folder(out)
    set_up_jax()
    robot = plant_of_baseline(plant)
    if is_baseline(run, robot):
        if all or setup is not None or seed is not None:
            raise CoachableError(
                f"{run} is a baseline, without setups and seeds; leave out --setup, --seed, --all"
            )
        from coachable.behaviours.library import load_behaviour
        from coachable.verification.passport.closed_loop import baseline_subject

        followed = None if behaviour is None else load_behaviour(behaviour)
        subjects: list[Subject | EpisodeSubject] = [baseline_subject(run, robot, semantics, clock, followed)]
        folder, beside = out, None
    else:
        say_imports(trust, run)
        subjects, beside = _subjects(run, setup, seed, which, deterministic, baseline, every=all)
        folder = out or Path(run) / "passports"
    passports = _verified(subjects, level, folder, beside, certify=certify, resume=all)
    _show(passports, subjects[0], summary=all, as_json=json)
    if all and folder is not None:
        from coachable.verification.passport.text import write_summary

        write_summary(passports, folder)
    if folder is not None:
        print(f"wrote {folder}", file=sys.stderr)


def _subjects(
    run: str,
    setup: str | None,
    seed: int | None,
    which: Which,
    deterministic: Deterministic | None,
    baseline: str | None,
    *,
    every: bool,
) -> tuple[list[Subject | EpisodeSubject], Subject | None]:
    """The lanes asked for, and the baseline of their run, if it is of a plant."""
    from coachable.envs.problem import PlantProblem
    from coachable.experiments.run_folder.reader import open_run
    from coachable.verification.passport.closed_loop import baseline_subject, lane_subject

    opened = open_run(run)
    plan, problem = opened.experiment, opened.experiment.problem
    if every:
        chosen = [] if setup is None else [opened.lane(setup, plan.first_seed).setup]
        lanes = [lane for lane in opened.lanes if not chosen or lane.setup in chosen]
    else:
        first = plan.first_seed if seed is None else seed
        lanes = [opened.lane(setup, first)]
    subjects = [lane_subject(opened, lane.setup, lane.seed, which, deterministic) for lane in lanes]
    if not isinstance(problem, PlantProblem):
        return subjects, None
    beside = baseline_subject(
        baseline or next(iter(problem.plant.controllers())),
        problem.plant,
        problem.semantics,
        subjects[0].walker.clock,
        opened.behaviour,
    )
    return subjects, beside


def _verified(
    subjects: list[Subject | EpisodeSubject],
    level: Literal["quick", "full"],
    folder: Path | None,
    baseline: Subject | None,
    *,
    certify: bool,
    resume: bool,
) -> list[Passport]:
    """The passports, those that are there already kept if `resume`."""
    from coachable.cli.progress import walkers_progress
    from coachable.verification.passport.verify import kept_passport, verify

    kept = {
        subject.walker.name: passport
        for subject in subjects
        if resume
        and folder is not None
        and (passport := kept_passport(folder, subject, level, certify)) is not None
    }
    if kept:
        print(f"{len(kept)} of {len(subjects)} passports are there already", file=sys.stderr)
    missing = [subject for subject in subjects if subject.walker.name not in kept]
    with walkers_progress("verify", len(missing)) as progress:
        made = verify(missing, level, folder, baseline, progress, certify=certify)
    by_name = kept | {passport.walker.name: passport for passport in made}
    return [by_name[subject.walker.name] for subject in subjects]


def _recheck(path: Path, *, as_json: bool) -> None:
    from rich.console import Console

    from coachable.verification.passport.attempts import require_crival

    require_crival()
    from coachable.verification.certificate.file import recheck

    with Console(stderr=True).status("proving") as status:
        verdict = recheck(path, progress=lambda done: status.update(f"proving: {done:.0%}"))
    if as_json:
        print_json({"claim": verdict.claim, "proven": verdict.proven, "reason": verdict.reason})
    else:
        print(verdict.claim)
        print(verdict.reason)
    if not verdict.proven:
        sys.exit(1)


def _show(
    passports: list[Passport], subject: Subject | EpisodeSubject, *, summary: bool, as_json: bool
) -> None:
    from rich.console import Console

    from coachable.verification.passport.closed_loop import Subject
    from coachable.verification.passport.passport import passport_data
    from coachable.verification.passport.text import print_passport, print_summary

    if as_json:
        data = [passport_data(passport) for passport in passports]
        print_json(data if summary else data[0])
        return
    console = Console(highlight=False)
    if not console.is_terminal:
        console = Console(highlight=False, width=100)
    if summary:
        print_summary(passports, console)
    else:
        print_passport(passports[0], subject.plant if isinstance(subject, Subject) else None, console)
