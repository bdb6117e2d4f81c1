"""What a robot is by itself, before anybody trains it: symmetry."""

from __future__ import annotations

from typing import TYPE_CHECKING, Annotated

from tyro.conf import Positional, arg

from coachable.cli.options import Trust, option, print_json, say_imports

if TYPE_CHECKING:
    from coachable.envs.symmetry.derived import DerivedSymmetry


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
    the signs that they have in the mirror. In what the two sides of the model differ is named. For example:

        coachable symmetry Walker2d-v5
        coachable symmetry Walker2d-v5 --behaviour perry-gait
        coachable symmetry Humanoid-v5 --json
        coachable symmetry mine.toml
    """
    from pathlib import Path

    from coachable.behaviours.library import load_behaviour
    from coachable.envs.problem import EnvironmentProblem, bare_environment
    from coachable.envs.symmetry.derived import derived_symmetry
    from coachable.experiments.plan import load_plan

    described, signals, options = None, None, {}
    if Path(env).is_file():
        say_imports(trust, env)
        problem = load_plan(env).problem
        if isinstance(problem, EnvironmentProblem):
            described, signals = problem.behaviour, problem.signal_sources
            env, options = problem.env, problem.env_options
    if behaviour is not None:
        described = load_behaviour(behaviour)
    found = derived_symmetry(bare_environment(env, options), described, signals)
    if json:
        print_json(_data(found))
    else:
        _show(found)


def _data(found: DerivedSymmetry) -> dict[str, object]:
    mirror = found.mirror
    return {
        "environment": found.environment,
        "observation": {"sources": mirror.observation.sources, "signs": mirror.observation.signs},
        "action": {"sources": mirror.action.sources, "signs": mirror.action.signs},
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
    observation = found.mirror.observation
    turned = sum(sign < 0 for sign in observation.signs)
    print(
        f"observation                  {len(observation.moved)} of {len(observation.sources)} numbers change "
        f"places, {turned} change their sign"
    )
    print("", "states and their images, at most so far apart after so many small steps:", sep="\n")
    for steps, error in found.errors.items():
        as_it_is = f", as the model is {found.errors_as_it_is[steps]:.0e}" if found.differences else ""
        print(f"  {steps:>3}   {error:.0e}{as_it_is}")
    if found.differences:
        print("", "The two sides of the model are not the same:", sep="\n")
        for each in found.differences:
            print(f"  {each.sentence}")
