"""Our classifier on random states of the walker, side by side."""

from __future__ import annotations

import jax
import numpy as np

from bench.orthants import BEHAVIOUR
from coachable.automata.classifier import Classifier
from coachable.experiments.trainers.compiled import COMPILER_OPTIONS


def prepare(num_states: int, library: str, calls: int):
    """Classify all states in float32, several times; units are states. JAX is compiled before it is timed."""
    classifier = Classifier.of(BEHAVIOUR)
    size = (len(classifier.signals), num_states)
    # Each signal's numbers lie side by side, as they come from a log or a batch of environments.
    states = np.random.default_rng(0).standard_normal(size, np.float32).T
    if library == "numpy":
        return lambda: [classifier(states) for _ in range(calls)], calls * num_states
    locate = jax.jit(classifier, compiler_options=COMPILER_OPTIONS)
    on_device = jax.device_put(states)
    np.testing.assert_array_equal(locate(on_device), classifier(states))
    return lambda: [locate(on_device).block_until_ready() for _ in range(calls)], calls * num_states
