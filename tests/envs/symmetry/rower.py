"""A boat with two oars, of no simulator: it goes straight if they pull alike, else it turns."""

import gymnasium
import numpy as np

from coachable.envs.symmetry.named_mirror import NamedImage, NamedMirror

ROBOT = "tests.envs.symmetry.rower:Rower-v0"
MIRROR = NamedMirror(NamedImage(swap=((1, 2),), flip=(0,)), NamedImage(swap=((0, 1),)))
TABLES = """
[signals]
left_oar = 1
right_oar = 2
[mirror]
observation = { swap = [[1, 2]], flip = [0] }
action = { swap = [[0, 1]] }
"""
ROWING = """
behaviour "rowing"

signals
  left_oar   [rad]  the angle of the oar
  right_oar  [rad]  the angle of the oar

mirror left <-> right

phases
  left_ahead for at most 0.4 s:  left_oar > right_oar

cycle
  left_ahead -> right_ahead
"""


class Rower(gymnasium.Env):
    """It observes its heading, the oars left and right, and how fast it goes ahead."""

    dt = 0.1
    observation_space = gymnasium.spaces.Box(-10.0, 10.0, (4,), np.float64)
    action_space = gymnasium.spaces.Box(-1.0, 1.0, (2,), np.float32)

    def reset(self, *, seed=None, options=None):
        super().reset(seed=seed)
        given = (options or {}).get("state")
        self.state = self.np_random.uniform(-0.5, 0.5, 4) if given is None else given
        return self.observation(), {}

    def step(self, action):
        left, right = np.asarray(action, float)
        heading, left_oar, right_oar, _ = self.state
        pulled = [np.sin(left_oar) * left, np.sin(right_oar) * right]
        oars = np.clip([left_oar + 0.3 * left, right_oar + 0.3 * right], -1, 1)
        self.state = np.array([heading + 0.1 * (pulled[1] - pulled[0]), *oars, sum(pulled)])
        return self.observation(), float(self.state[3]), False, False, {}

    def observation(self):
        return self.state.copy()


gymnasium.register("Rower-v0", Rower, max_episode_steps=40)
