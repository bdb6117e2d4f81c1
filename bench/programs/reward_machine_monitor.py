"""pyrewardmachines over a recorded walk, sample by sample."""

from __future__ import annotations

import numpy as np

from bench.orthants import our_verdicts, reward_machine, trace


def prepare(num_samples: int):
    """Check that the verdicts are ours, then watch the trace; units are samples."""
    columns = trace(num_samples)
    states = list(np.stack(list(columns.values()), axis=-1))
    floats = [state.tolist() for state in states]

    def work():
        machine, where = reward_machine()
        place, counters, rewards = machine.u_0, machine.c_0, []
        for state in floats:
            place, counters, reward = machine.transition(place, counters, where(None, None, state))
            rewards.append(reward(None, None, state))
        return rewards

    np.testing.assert_array_equal(np.array(work())[1:] > 0, our_verdicts(columns))
    return work, num_samples
