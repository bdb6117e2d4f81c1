"""Every signal of the BipedalWalker pack is poked in its Box2D world."""

import gymnasium
import numpy as np
import pytest

from coachable.envs.signals import signal_pack

pytest.importorskip("Box2D", reason="needs the [box2d] extra: pip install 'coachable[box2d]'")

STEP = 1 / 50
LEGS = {"left": 0, "right": 1}
each_leg = pytest.mark.parametrize("side", LEGS)


class Walker:
    """The environment, its bodies, and a reader made once, before any reset."""

    def __init__(self):
        self.env = gymnasium.make("BipedalWalker-v3")
        self.base = self.env.unwrapped
        self._read = signal_pack(self.env).reader(self.env)
        self.base.reset(seed=0)

    def read(self):
        return self._read(None, {})

    def bodies(self, side):
        """Thigh and shank."""
        return self.base.legs[2 * LEGS[side]], self.base.legs[2 * LEGS[side] + 1]

    def lift(self, height):
        """All of the walker, at rest."""
        for body in (self.base.hull, *self.base.legs):
            body.position = (body.position[0], body.position[1] + height)
            body.linearVelocity, body.angularVelocity = (0, 0), 0
        return self.read()

    def drive(self, action, num_steps=6):
        """Motors on, in the air."""
        for _ in range(num_steps):
            self.base.step(np.array(action, np.float32))
        return self.read()


@pytest.fixture
def walker():
    return Walker()


def motors(side, hip, knee):
    action = np.zeros(4)
    action[2 * LEGS[side] : 2 * LEGS[side] + 2] = hip, knee
    return action


def test_the_leg_behind_the_other_in_the_picture_is_the_left_one(walker):
    """What is drawn later is in front. The walker goes to the right: we see its right side."""
    drawn = walker.base.drawlist
    assert drawn.index(walker.bodies("left")[0]) < drawn.index(walker.bodies("right")[0])


@each_leg
def test_a_flexed_hip_has_the_thigh_in_front(walker, side):
    before = walker.lift(2.0)
    after = walker.drive(motors(side, hip=1, knee=0))
    assert after[f"{side}_hip"] > before[f"{side}_hip"] + 0.2
    thigh, _ = walker.bodies(side)
    hip = np.array(walker.base.joints[2 * LEGS[side]].anchorA)
    below = np.array(walker.base.hull.GetLocalVector(np.array(thigh.worldCenter) - hip))
    assert below[0] > 0
    assert after[f"{side}_hip"] == pytest.approx(np.arctan2(below[0], -below[1]), abs=0.02)
    other = next(name for name in LEGS if name != side)
    assert abs(after[f"{other}_hip"] - before[f"{other}_hip"]) < 0.15


@each_leg
def test_a_flexed_knee_has_the_shank_behind(walker, side):
    before = walker.lift(2.0)
    after = walker.drive(motors(side, hip=0, knee=-1))
    assert after[f"{side}_knee"] > before[f"{side}_knee"] + 0.2
    thigh, shank = walker.bodies(side)
    knee = walker.base.joints[2 * LEGS[side] + 1].anchorA
    along, away = np.array(thigh.GetWorldVector((0, -1))), np.array(shank.worldCenter) - knee
    turned = np.arctan2(along[1] * away[0] - along[0] * away[1], along @ away)
    assert turned > 0, "clockwise from the thigh: behind it"
    assert after[f"{side}_knee"] == pytest.approx(turned, abs=0.02)


@each_leg
def test_joint_velocities(walker, side):
    thigh, shank = walker.bodies(side)
    walker.lift(2.0)
    thigh.angularVelocity = 0.7
    seen = walker.read()
    assert seen[f"{side}_hip_velocity"] == pytest.approx(0.7)
    assert seen[f"{side}_knee_velocity"] == pytest.approx(0.7)
    shank.angularVelocity = 1.0
    assert walker.read()[f"{side}_knee_velocity"] == pytest.approx(-0.3)


def test_the_hull(walker):
    before = walker.lift(2.0)
    hull = walker.base.hull
    hull.linearVelocity, hull.angularVelocity = (1.5, -0.4), 0.6
    seen = walker.read()
    assert [seen[name] for name in ("forward_speed", "vertical_speed", "pitch_velocity")] == pytest.approx(
        [1.5, -0.4, -0.6]
    )
    hull.angle = -0.3
    assert walker.read()["pitch"] == pytest.approx(0.3)
    nose = hull.GetWorldVector((1, 0))
    assert nose[1] < 0, "nose down"
    hull.angle = 0.0
    hull.position = (hull.position[0] + 0.5, hull.position[1] + 0.2)
    moved = walker.read()
    assert moved["torso_x"] - before["torso_x"] == pytest.approx(0.5, abs=1e-2)
    assert moved["torso_height"] - before["torso_height"] == pytest.approx(0.2, abs=1e-2)


@each_leg
def test_a_foot_is_where_the_leg_puts_it(walker, side):
    """Thigh and shank of 34/30 m each hang from the hip."""
    length = 34 / 30
    walker.lift(2.0)
    thigh, shank = walker.bodies(side)
    hip = np.array(walker.base.joints[2 * LEGS[side]].anchorA)

    def place(body, top, angle):
        """A leg of this length that hangs from a point, turned forward; returns its lower end."""
        down = np.array([np.sin(angle), -np.cos(angle)])
        body.angle, body.position = angle, tuple(top + length / 2 * down)
        return top + length * down

    for thigh_angle, shank_angle in ((0.0, 0.0), (0.4, 0.1), (-0.5, -0.9)):
        foot = place(shank, place(thigh, hip, thigh_angle), shank_angle)
        seen = walker.read()
        assert seen[f"{side}_foot_x"] == pytest.approx(foot[0] - hip[0], abs=1e-4)
        lowest = foot[1] - 0.8 * 8 / 30 / 2 * abs(np.sin(shank_angle))
        ground = np.interp(foot[0], walker.base.terrain_x, walker.base.terrain_y)
        assert seen[f"{side}_foot_height"] == pytest.approx(lowest - ground, abs=1e-4)


@each_leg
def test_the_foot_that_stands_is_the_one_in_contact(walker, side):
    other = next(name for name in LEGS if name != side)
    walker.lift(0.5)
    seen = walker.drive(np.zeros(4), 1)
    assert (seen["left_foot_contact"], seen["right_foot_contact"]) == (0, 0)
    for _ in range(100):
        seen = walker.drive(motors(other, hip=1, knee=-1), 1)
        if seen[f"{side}_foot_contact"]:
            break
    assert seen[f"{side}_foot_contact"] == 1
    assert seen[f"{other}_foot_contact"] == 0
    assert abs(seen[f"{side}_foot_height"]) < 0.05
    assert seen[f"{other}_foot_height"] > 0.1


def test_a_foot_that_goes_from_one_piece_of_the_ground_to_the_next_stays_in_contact(walker):
    """The environment's own flag, which is in its observation, goes out there."""
    rng = np.random.default_rng(0)
    disagreed, highest = 0, 0.0
    for seed in range(4):
        walker.base.reset(seed=seed)
        for _ in range(150):
            action = rng.uniform(-1, 1, 4).astype(np.float32)
            before = walker.read()
            *_, terminated, _, _ = walker.base.step(action)
            seen = walker.read()
            for side in LEGS:
                _, shank = walker.bodies(side)
                touches, flag = bool(seen[f"{side}_foot_contact"]), shank.ground_contact
                disagreed += touches and not flag
                assert touches or not flag
                height = f"{side}_foot_height"
                highest = max(highest, touches * min(before[height], seen[height]))
            if terminated:
                break
    assert disagreed > 0
    assert highest < 0.05, "contacts are those that a step begins with"


def test_velocities_are_the_derivatives_of_what_they_say(walker):
    walker.lift(1.0)
    rng = np.random.default_rng(1)
    seen = [walker.read()]
    for _ in range(25):
        walker.base.step(rng.uniform(-0.3, 0.3, 4).astype(np.float32))
        seen.append(walker.read())
    derivatives = [signal for signal in signal_pack("BipedalWalker-v3").signals if signal.derivative_of]
    assert len(derivatives) == 6
    for signal in derivatives:
        position = np.array([values[signal.derivative_of] for values in seen])
        velocity = np.array([values[signal.name] for values in seen])
        difference = np.diff(position) / STEP
        slack = np.abs(np.diff(velocity)) + 0.05 * np.abs(velocity[1:]) + 5e-3
        assert np.mean(np.abs(difference - velocity[1:]) <= slack) > 0.9, signal.name
        assert np.abs(velocity).max() > 0.01, signal.name


def test_every_signal_is_poked_above():
    legs = {f"{s}_{j}{v}" for s in LEGS for j in ("hip", "knee") for v in ("", "_velocity")}
    feet = {f"{side}_foot_{what}" for side in LEGS for what in ("x", "height", "contact")}
    hull = {
        "torso_x",
        "torso_height",
        "forward_speed",
        "vertical_speed",
        "pitch",
        "pitch_velocity",
        "feet_down",
    }
    assert legs | feet | hull == {signal.name for signal in signal_pack("BipedalWalker-v3").signals}
