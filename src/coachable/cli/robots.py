"""What a robot is by itself, before anybody trains it: symmetry."""

from __future__ import annotations

from typing import TYPE_CHECKING, Annotated

from tyro.conf import Positional, arg

from coachable.cli.options import Trust, option, print_json, say_imports

if TYPE_CHECKING:
    from coachable.envs.symmetry.derived import DerivedSymmetry, RobotMirror


def symmetry(
    env: Annotated[Positional[str], arg(metavar="ENV", help="What gymnasium.make takes, or a plan's file.")],
    behaviour: Annotated[
        str | None,
        option(
            "NAME|FILE",
            "A description with a mirror, whose signals have to change places as it says.",
            otherwise="a plan's, or none",
        ),
    ] = None,
    json: Annotated[bool, arg(help="Print JSON.")] = False,
    trust: Trust = False,
) -> None:
    """Derive what a MuJoCo robot looks like in a mirror, and test it against the simulator.

    Left and right are exchanged: bodies are paired by where they lie at home, motors and observations with
    the signs that they have in the mirror. In what the two sides of the model differ is named. What a plan
    names in its table [mirror] is shown as it is, untested. For example:

        coachable symmetry Walker2d-v5
        coachable symmetry Walker2d-v5 --behaviour perry-gait
        coachable symmetry Humanoid-v5 --json
        coachable symmetry mine.toml
    """
    from contextlib import closing
    from pathlib import Path

    from gymnasium.spaces import flatdim

    from coachable.behaviours.library import load_behaviour
    from coachable.envs.problem import EnvironmentProblem, bare_environment
    from coachable.envs.symmetry.derived import derived_symmetry
    from coachable.experiments.plan import load_plan

    described, signals, options, named = None, None, {}, None
    if Path(env).is_file():
        say_imports(trust, env)
        problem = load_plan(env).problem
        if isinstance(problem, EnvironmentProblem):
            described, signals, named = problem.behaviour, problem.signal_sources, problem.mirror_image
            env, options = problem.env, problem.env_options
    if behaviour is not None:
        described = load_behaviour(behaviour)
    robot = bare_environment(env, options)
    if named is not None:
        with closing(robot):
            mirror = named.of(flatdim(robot.observation_space), robot)
        if json:
            print_json({"environment": env, **_map(mirror)})
        else:
            print(f"{env} in the mirror, as the plan names it: neither derived nor tested", "", sep="\n")
            _show_map(mirror)
        return
    found = derived_symmetry(robot, described, signals)
    if json:
        print_json(_data(found))
    else:
        _show(found)


def _map(mirror: RobotMirror) -> dict[str, object]:
    return {
        name: {"sources": image.sources, "signs": image.signs}
        for name, image in (("observation", mirror.observation), ("action", mirror.action))
    }


def _data(found: DerivedSymmetry) -> dict[str, object]:
    return {
        "environment": found.environment,
        **_map(found.mirror),
        "exchanged": found.exchanged,
        "differences": [each.sentence for each in found.differences],
        "errors": {str(steps): error for steps, error in found.errors.items()},
        "errors_as_it_is": {str(steps): error for steps, error in found.errors_as_it_is.items()},
    }


def _show(found: DerivedSymmetry) -> None:
    print(f"{found.environment} in the mirror", "", sep="\n")
    pairs = {"bodies that change places": found.exchanged, "motors": found.motors}
    for what, each in pairs.items():
        print(f"{what:<28}", ", ".join(" ↔ ".join(pair) for pair in each if all(pair)))
    _show_map(found.mirror)
    print("", "states and their images, at most so far apart after so many small steps:", sep="\n")
    for steps, error in found.errors.items():
        as_it_is = f", as the model is {found.errors_as_it_is[steps]:.0e}" if found.differences else ""
        print(f"  {steps:>3}   {error:.0e}{as_it_is}")
    if found.differences:
        print("", "The two sides of the model are not the same:", sep="\n")
        for each in found.differences:
            print(f"  {each.sentence}")


def _show_map(mirror: RobotMirror) -> None:
    for what, image in (("observation", mirror.observation), ("action", mirror.action)):
        turned = sum(sign < 0 for sign in image.signs)
        print(
            f"{what:<28} {len(image.moved)} of {len(image.sources)} numbers change places, "
            f"{turned} change their sign"
        )
