"""A plant with the controller that drives it."""

from collections.abc import Sequence
from typing import Literal, TypeVar

import equinox as eqx
import jax
import jax.numpy as jnp
from jaxtyping import Array, Float

from coachable.plants.event_search import PAPER_CHATTER, ChatterRule
from coachable.plants.metered import Metered
from coachable.plants.plant import Controller, Plant

Hold = Literal["sampled", "continuous"]

Tree = TypeVar("Tree")


class ClosedLoop(eqx.Module):
    """A plant and the controller that drives it: what a passport is about.

    `hold` says whether the control is sampled every `control_dt` and held, as in training, or follows the
    state continuously. Arrays inside (a policy's weights) are arguments of whatever is compiled, so loops of
    one kind share a program, and stacked ones are vmapped.
    """

    plant: Plant
    controller: Controller
    hold: Hold = eqx.field(static=True, default="sampled")
    control_dt: float = eqx.field(static=True, default=0.01)
    num_substeps: int = eqx.field(static=True, default=4)
    """Runge–Kutta steps in a control step."""
    chatter: ChatterRule = eqx.field(static=True, default=PAPER_CHATTER)
    """Under the free clock; a clock that restarts at touchdown has the paper's rule."""

    @property
    def metered(self) -> Metered:
        """What is integrated: the plant with a meter for its actuators' work."""
        return Metered(self.plant, self.controller if self.hold == "continuous" else None)

    def metered_control(self, x: Float[Array, " metered"]) -> Float[Array, " control"]:
        """The control that the controller applies in a state of `metered`."""
        return self.controller(x[:-1])


def stacked(loops: Sequence[ClosedLoop]) -> ClosedLoop:
    """Loops of one kind as one whose arrays have a leading axis."""
    return jax.tree.map(lambda *leaves: jnp.stack([jnp.asarray(leaf) for leaf in leaves]), *loops)


def in_double(tree: Tree) -> Tree:
    """The same with its float arrays in float64, exactly; to be called under `jax.enable_x64(True)`."""

    def widened(leaf):
        return jnp.asarray(leaf, jnp.float64) if eqx.is_inexact_array(leaf) else leaf

    return jax.tree.map(widened, tree)
