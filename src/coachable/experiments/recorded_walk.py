"""An episode of a lane as it is recorded: in an environment or of a plant."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from jaxtyping import Bool, Float, Int

from coachable.automata.trace import Trace
from coachable.behaviours.behaviour import Phase


@dataclass(frozen=True, eq=False)
class RecordedWalk:
    """An episode: its signals, its phases and what was paid."""

    title: str
    trace: Trace
    """Of all signals in the environment's signal pack, or of those of the behaviour; of a plant's, see
    `recorded_plant_walk`."""
    dt: float
    """Time between two steps [s]; where a touchdown restarts the clock, on average."""
    phase: Int[np.ndarray, " samples"]
    """Location in the behaviour: 0 … K−1, or K outside all K phases."""
    follows: Bool[np.ndarray, " samples"]
    """Whether the step to each sample belongs to the behaviour; the first sample has none before it."""
    phases: tuple[Phase, ...]
    """The behaviour's."""
    environment_return: float
    """What the environment itself paid; of a plant's return, what is not the behaviour's."""
    behaviour_return: float
    """What the described reward came to, with its weight."""
    fell: bool
    """Whether the episode terminated; of a plant, whether it fell."""
    absent: tuple[str, ...] = ()
    """Why parts of the gait cannot be measured, a sentence each."""
    limbs: tuple[str, ...] = ()
    """Names of the parts that can be drawn: the capsules of a MuJoCo robot."""
    ends: Float[np.ndarray, "samples limbs 2 3"] | None = None
    """Where both ends of each are [m]."""
    radii: Float[np.ndarray, " limbs"] | None = None
    """[m]"""

    @property
    def time(self) -> Float[np.ndarray, " samples"]:
        """Of the trace [s]."""
        return self.trace.time
