"""The behaviours that ship: the ideal walking cycle of the paper, as printed and as its code reads it."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path
from types import MappingProxyType

from coachable.behaviours.behaviour import Behaviour, Edge, Phase, located
from coachable.behaviours.predicates import All, Comparison, Signal
from coachable.behaviours.suggestion import suggestion
from coachable.errors import BehaviourError

_COMPASS_STATE = (
    Signal(
        "theta_1", "rad", "angle of the stance leg from upright; positive while the hip is behind the foot"
    ),
    Signal(
        "theta_2", "rad", "angle of the swing leg from upright; positive while its foot is ahead of the hip"
    ),
    Signal("dtheta_1", "rad/s", "angular velocity of the stance leg; negative while the hip moves forward"),
    Signal("dtheta_2", "rad/s", "angular velocity of the swing leg; positive while it swings forward"),
)


def _ideal_walking(name: str, description: str, negative: str) -> Behaviour:
    """The four orthants of the paper's figure 3, each a sign for every coordinate of the state, in a cycle.

    `negative` is the relation that a − stands for, which is all that the paper and its code disagree in.
    """

    def orthant(signs: str) -> All:
        relations: Mapping[str, str] = {"+": ">", "-": negative}
        return All(
            *(
                Comparison(signal.name, relations[sign], 0.0)
                for signal, sign in zip(_COMPASS_STATE, signs, strict=True)
            )
        )

    return Behaviour(
        name=name,
        description=description,
        signals=_COMPASS_STATE,
        phases=(
            Phase("O1", "swing leg behind the hip", orthant("+--+")),
            Phase("O2", "swing leg ahead of the hip", orthant("++-+")),
            Phase("O3", "hip ahead of the stance foot", orthant("-+-+")),
            Phase("O4", "swing leg comes back", orthant("-+--")),
        ),
        edges=(Edge("O1", "O2"), Edge("O2", "O3"), Edge("O3", "O4"), Edge("O4", "O1", event="touchdown")),
    )


SHIPPED: Mapping[str, Behaviour] = MappingProxyType(
    {
        behaviour.name: behaviour
        for behaviour in (
            _ideal_walking(
                "compass-walking",
                "Ideal walking of the compass walker: eqs. (7) to (13) of Harnack et al., CDC 2023.",
                negative="<=",
            ),
            _ideal_walking(
                "compass-walking-released",
                "Ideal walking as in the code of Harnack et al., CDC 2023: a zero is in no phase.",
                negative="<",
            ),
        )
    }
)


def load_behaviour(name_or_path: str | Path) -> Behaviour:
    """A shipped behaviour by its name, or one from a file by its path.

    **Arguments:** `name_or_path`: `"compass-walking"`, `"compass-walking-released"`, or a file that
    `Behaviour.to_json` wrote.

    **Raises:** `BehaviourError` for a name that is neither, with the nearest one that is, or a file that
    cannot be read, saying where.
    """
    if name_or_path in SHIPPED:
        return SHIPPED[str(name_or_path)]
    path = Path(name_or_path)
    if not path.is_file():
        raise BehaviourError(
            f"{str(name_or_path)!r} is neither a behaviour that ships nor a file; "
            + suggestion(str(name_or_path), SHIPPED)
        )
    with located(str(path)):
        try:
            from coachable.behaviours.parser import parse

            return parse(path.read_text(encoding="utf-8"))
        except (OSError, UnicodeDecodeError) as error:
            raise BehaviourError(f"cannot be read as text: {error}") from None
