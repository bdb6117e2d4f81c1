"""A plant with the controller that drives it."""

from collections.abc import Callable, Sequence
from typing import Any, Literal, TypeVar

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, Bool, Float, PyTree

from coachable.plants.event_search import PAPER_CHATTER, ChatterRule
from coachable.plants.metered import Metered
from coachable.plants.plant import Controller, Dynamics, Plant
from coachable.plants.sampled import SampledStep, Sampling, sampled_walk
from coachable.rewards.controller_memory import ControllerMemory, Remembered

Hold = Literal["sampled", "continuous"]

Recall = Remembered | tuple[()]
"""What a loop's controller remembers; `()` of a state feedback."""

Disturb = Callable[[Array, PyTree, Any], tuple[Array, PyTree]]
"""(the control wanted, memory, input) ↦ the control to be held, and the memory."""

Observe = Callable[[SampledStep, Recall, PyTree], tuple[PyTree, PyTree, Array]]
"""(step, what the controller remembers after it, memory) ↦ memory, what is recorded, whether it has ended."""

Tree = TypeVar("Tree")


class ClosedLoop(eqx.Module):
    """A plant and the controller that drives it: what a passport is about.

    `hold` says whether the control is sampled every `control_dt` and held, as in training, or follows the
    state continuously. Arrays inside (a policy's weights) are arguments of whatever is compiled, so loops of
    one kind share a program, and stacked ones are vmapped.

    A policy that observes more than the state is a controller with a memory, and what the loop remembers
    belongs to its state. So a *point* of its return map is the point of the plant's section, and behind it,
    as numbers, all that is remembered there. The memory begins with the walk, and goes on at every sample.
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
        """The plant with a meter for its actuators' work."""
        return Metered(self.plant, self.controller if self.hold == "continuous" else None)

    @property
    def memory(self) -> ControllerMemory | None:
        """The controller's; `None` for a state feedback."""
        return ControllerMemory.of(self.controller)

    def begun(self, x: Float[Array, " state"]) -> Recall:
        """What is remembered where a walk begins."""
        return () if self.memory is None else self.memory.begun(self._signals(x))

    def after(self, recall: Recall, x: Float[Array, " state"], elapsed: Float[Array, ""]) -> Recall:
        """What is remembered at the next sample, taken so many seconds after the last one."""
        if self.memory is None or not isinstance(recall, Remembered):
            return recall
        return self.memory.after(recall, self._signals(x), elapsed)

    def wanted(self, x: Float[Array, " state"], recall: Recall) -> Float[Array, " control"]:
        """The control that the controller asks for."""
        if self.memory is None or not isinstance(recall, Remembered):
            return self.controller(x)
        return self.controller(jnp.append(x, self.memory.shown(recall, self._signals(x))))

    def _signals(self, x: Float[Array, " state"]) -> Float[Array, " signals"]:
        return self.plant.signals(x, () if self.memory is None else self.memory.signal_names)

    def walk(
        self,
        sampling: Sampling,
        x0: Float[Array, " state"],
        observe: Observe,
        num_steps: int | None,
        *,
        recall: Recall | None = None,
        memory: PyTree = None,
        inputs: PyTree = None,
        disturb: Disturb | None = None,
        dynamics: Dynamics | None = None,
    ) -> tuple[PyTree, PyTree, Bool[Array, " steps"] | None]:
        """`sampled_walk` in this loop, undisturbed unless `disturb` is given.

        **Arguments:** `recall`, what is remembered at the start, by default nothing of the time before it;
        `memory`, of `disturb` and `observe`; `dynamics`, what is integrated in place of the plant, whose
        states may have more coordinates behind the plant's.
        """
        size = len(self.plant.state_names)

        def control(x: Array, both: PyTree, given: Any) -> tuple[Array, PyTree]:
            own, others = both
            held = self.wanted(x[:size], own)
            if disturb is not None:
                held, others = disturb(held, others, given)
            return held, (own, others)

        def observed(step: SampledStep, both: PyTree) -> tuple[PyTree, PyTree, Array]:
            own, others = both
            own = self.after(own, step.moved.x[:size], step.moved.elapsed)
            others, record, ended = observe(step, own, others)
            return (own, others), record, ended

        both = (self.begun(x0[:size]) if recall is None else recall, memory)
        (_, memory), records, alive = sampled_walk(
            dynamics or self.plant, sampling, control, x0, observed, num_steps, memory=both, inputs=inputs
        )
        return memory, records, alive

    def point(self, x: Float[Array, " state"], recall: Recall) -> Float[Array, " point"]:
        """Of the return map, for a state right after a touchdown."""
        return jnp.concatenate([self.plant.to_section(x), self.numbers(recall, x)])

    def at_point(self, point: Float[Array, " point"]) -> tuple[Float[Array, " state"], Recall]:
        """The inverse of `point`."""
        size = len(self.plant.section_names)
        x = self.plant.from_section(point[:size])
        return x, self.recalled(point[size:])

    def numbers(self, recall: Recall, x: Float[Array, " state"]) -> Float[Array, " memory"]:
        """All that is remembered as numbers, in the dtype of a state."""
        if self.memory is None or not isinstance(recall, Remembered):
            return jnp.zeros(0, x.dtype)
        return self.memory.numbers(recall, x)

    def recalled(self, numbers: Float[Array, " memory"]) -> Recall:
        """The inverse of `numbers`; what is whole or true or false is rounded to it."""
        return () if self.memory is None else self.memory.recalled(numbers)

    @property
    def continuous(self) -> Bool[np.ndarray, " point"]:
        """Which coordinates of a point are real numbers; the others are phases, or true or false."""
        section = np.ones(len(self.plant.section_names), bool)
        return section if self.memory is None else np.append(section, self.memory.real)


def stacked(loops: Sequence[ClosedLoop]) -> ClosedLoop:
    """Loops of one kind as one whose arrays have a leading axis."""
    return jax.tree.map(lambda *leaves: jnp.stack([jnp.asarray(leaf) for leaf in leaves]), *loops)


def in_double(tree: Tree) -> Tree:
    """The same with its float arrays in float64, exactly; to be called under `jax.enable_x64(True)`."""

    def widened(leaf):
        return jnp.asarray(leaf, jnp.float64) if eqx.is_inexact_array(leaf) else leaf

    return jax.tree.map(widened, tree)
