"""Every signal of the MuJoCo packs is poked in the simulator: the right one moves, that far, that way."""

import math

import gymnasium
import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from coachable.behaviours.library import load_behaviour
from coachable.envs.signals import SIGNAL_PACKS, signal_pack

mujoco = pytest.importorskip("mujoco", reason="needs the [mujoco] extra: pip install 'coachable[mujoco]'")

ROBOTS = tuple(name for name in SIGNAL_PACKS if name != "BipedalWalker-v3")
X, Y, Z = 0, 1, 2
UP = 1.0
"""How far robots are lifted, so that nothing touches [m]."""
MARGIN = {"Ant-v5": 0.02}
"""How far from the floor feet begin to press on it, by the models' margins of contact [m]."""


class Robot:
    """An environment whose robot is put into a pose, by the names of its joints, and then looked at."""

    def __init__(self, name):
        self.env = gymnasium.make(name)
        self.env.reset(seed=0)
        self.base = self.env.unwrapped
        self.model, self.data = self.base.model, self.base.data
        self._read = signal_pack(self.env).reader(self.env)

    def put(self, up=UP, quaternion=None, velocities=(), **joints):
        mujoco.mj_resetData(self.model, self.data)
        self.data.qpos[:] = self.base.init_qpos
        if "root" in (self.model.joint(i).name for i in range(self.model.njnt)):
            self.data.joint("root").qpos[2] += up
            if quaternion is not None:
                self.data.joint("root").qpos[3:] = quaternion
        else:
            self.data.joint("rootz").qpos += up
        for joint, value in joints.items():
            self.data.joint(joint).qpos = value
        for joint, value in dict(velocities).items():
            self.data.joint(joint).qvel = value
        mujoco.mj_forward(self.model, self.data)
        return self.read()

    def read(self):
        return self._read(None, {})

    def place(self, geom):
        return self.data.geom(geom).xpos.copy()


@pytest.fixture(scope="module")
def robots():
    return {name: Robot(name) for name in ROBOTS}


ANT_LEGS = (
    # name, the model's foot, the number of its joints, their signs, where it is ahead of and beside its hip
    ("front_left", "left_ankle_geom", 1, -1, +1, +1, +1),
    ("front_right", "fourth_ankle_geom", 4, +1, +1, +1, -1),
    ("back_left", "right_ankle_geom", 2, -1, -1, -1, +1),
    ("back_right", "third_ankle_geom", 3, +1, -1, -1, -1),
)

HINGES = [
    # signal, joint, the joint's sign for a positive signal, a geom below, the direction in which that moves
    *(
        (name, *poke)
        for name, prefix, suffix in (
            ("Walker2d-v5", "left_", "_left"),
            ("Walker2d-v5", "right_", ""),
            ("Hopper-v5", "", ""),
        )
        for poke in (
            (f"{prefix}hip", f"thigh{suffix}_joint", +1, f"leg{suffix}_geom", (X, +1)),
            (f"{prefix}knee", f"leg{suffix}_joint", -1, f"foot{suffix}_geom", (X, -1)),
            (f"{prefix}ankle", f"foot{suffix}_joint", +1, f"foot{suffix}_geom", (Z, +1)),
        )
    ),
    *(
        ("HalfCheetah-v5", *poke)
        for prefix, letter in (("back_", "b"), ("front_", "f"))
        for poke in (
            (f"{prefix}hip", f"{letter}thigh", -1, f"{letter}thigh", (X, +1)),
            (f"{prefix}knee", f"{letter}shin", -1, f"{letter}shin", (X, +1)),
            (f"{prefix}ankle", f"{letter}foot", -1, f"{letter}foot", (X, +1)),
        )
    ),
    *(
        ("Humanoid-v5", *poke)
        for side, outwards in (("left", +1), ("right", -1))
        for poke in (
            (f"{side}_hip", f"{side}_hip_y", -1, f"{side}_shin1", (X, +1)),
            (f"{side}_hip_abduction", f"{side}_hip_x", -1, f"{side}_shin1", (Y, outwards)),
            (f"{side}_knee", f"{side}_knee", -1, f"{side}_foot", (X, -1)),
        )
    ),
    *(
        ("Ant-v5", *poke)
        for leg, foot, number, swing, bend, _, _ in ANT_LEGS
        for poke in (
            (f"{leg}_hip", f"hip_{number}", swing, foot, (X, +1)),
            (f"{leg}_ankle", f"ankle_{number}", bend, foot, (Z, -1)),
        )
    ),
]


@pytest.mark.parametrize(("name", "signal", "joint", "sign", "geom", "moves"), HINGES)
def test_a_joint_is_read_with_its_sign_and_alone(robots, name, signal, joint, sign, geom, moves):
    robot, (axis, direction) = robots[name], moves
    rest, at_rest = robot.put(), robot.place(geom)
    bent = robot.put(**{joint: sign * 0.3})
    assert bent[signal] == pytest.approx(0.3)
    assert direction * (robot.place(geom) - at_rest)[axis] > 0.005
    changed = {key for key in rest if abs(bent[key] - rest[key]) > 1e-9}
    side = signal.split("_")[0] if "_" in signal else ""
    assert signal in changed
    below = ("foot", "shank", "sole", "leg")
    assert changed <= {signal} | {
        key for key in rest if key.startswith(side) and any(w in key for w in below)
    }
    moving = robot.put(velocities={joint: sign * 0.7})
    alone = {key: value for key, value in moving.items() if value != rest[key] and "leg" not in key}
    assert alone == {f"{signal}_velocity": pytest.approx(0.7)}


@pytest.mark.parametrize(("side", "inwards"), [("left", -1), ("right", +1)])
def test_a_turned_in_hip_turns_the_bent_shank_out(robots, side, inwards):
    """With the knee bent to 90° the foot is behind; turned about the thigh's axis, toes in is heel out."""
    robot = robots["Humanoid-v5"]
    knee = {f"{side}_knee": -math.pi / 2}
    robot.put(**knee)
    straight = robot.place(f"{side}_foot")
    joint = f"{side}_hip_z"
    turned = robot.put(**knee, **{joint: 0.3})
    assert turned[f"{side}_hip_rotation"] == pytest.approx(0.3)
    assert inwards * (robot.place(f"{side}_foot") - straight)[Y] < -0.05
    assert robot.put(velocities={joint: 0.7})[f"{side}_hip_rotation_velocity"] == pytest.approx(0.7)


@pytest.mark.parametrize("name", ROBOTS[:3])
def test_the_torso_of_a_planar_robot(robots, name):
    robot = robots[name]
    rest = robot.put()
    there = robot.put(up=UP + 0.2, rootx=3.0, velocities={"rootx": 1.5, "rootz": -0.4, "rooty": 0.6})
    assert there["torso_x"] - rest["torso_x"] == pytest.approx(3.0)
    assert there["torso_height"] - rest["torso_height"] == pytest.approx(0.2)
    assert there["forward_speed"] == pytest.approx(1.5)
    assert there["vertical_speed"] == pytest.approx(-0.4)
    assert there["pitch_velocity"] == pytest.approx(0.6)
    upright = {"Walker2d-v5": 1.25, "Hopper-v5": 1.25, "HalfCheetah-v5": 0.7}
    assert rest["torso_height"] == pytest.approx(UP + upright[name])
    foot = next(key for key in rest if key.endswith("foot_x"))
    assert there[foot] == pytest.approx(rest[foot])
    assert robot.put(rooty=0.3)["pitch"] == pytest.approx(0.3)
    head = robot.data.body("torso").xmat.reshape(3, 3) @ (1.0, 0.0, 1.0)
    assert head[X] > 1.1, "leaning forward, the head is in front"
    assert head[Z] < 0.9, "and the nose down"


def test_the_torso_of_the_humanoid(robots):
    robot = robots["Humanoid-v5"]
    roll, pitch, yaw = -0.2, 0.3, 0.5
    turned = Rotation.from_euler("ZYX", [yaw, pitch, roll])
    omega = np.array([0.3, -0.5, 0.8])
    free = np.concatenate([[1.5, -0.4, 0.2], omega])
    seen = robot.put(quaternion=turned.as_quat(scalar_first=True), velocities={"root": free})
    assert [seen[name] for name in ("roll", "pitch", "yaw")] == pytest.approx([roll, pitch, yaw])
    speeds = [seen[name] for name in ("forward_speed", "leftward_speed", "vertical_speed")]
    assert speeds == pytest.approx([1.5, -0.4, 0.2])
    later = turned * Rotation.from_rotvec(1e-6 * omega)
    expected = (later.as_euler("ZYX") - [yaw, pitch, roll]) / 1e-6
    rates = [seen[f"{name}_velocity"] for name in ("yaw", "pitch", "roll")]
    assert rates == pytest.approx(expected.tolist(), rel=1e-4)
    rest = robot.put()
    assert rest["torso_height"] == pytest.approx(UP + 1.4)
    assert rest["torso_x"] == rest["torso_y"] == 0

    def up_axis(name, angle):
        axis = {"roll": "x", "pitch": "y", "yaw": "z"}[name]
        robot.put(quaternion=Rotation.from_euler(axis, angle).as_quat(scalar_first=True))
        return robot.data.body("torso").xmat.reshape(3, 3)

    assert up_axis("pitch", 0.3)[X, Z] > 0.2, "leaning forward"
    assert up_axis("roll", 0.3)[Y, Z] < -0.2, "leaning to the right"
    assert up_axis("yaw", 0.3)[Y, X] > 0.2, "facing left"
    robot.data.joint("root").qpos[:2] = 2.0, 3.0
    mujoco.mj_forward(robot.model, robot.data)
    assert (robot.read()["torso_x"], robot.read()["torso_y"]) == pytest.approx((2.0, 3.0))


FEET = [
    # the foot's prefix, its hip joint with its sign, and, from the model's file: how far the foot's middle is
    # ahead of the hip and below it, how high the lowest point of the foot stands
    ("Walker2d-v5", "left_", "thigh_left_joint", +1, 0.1, 0.95, 0.04),
    ("Walker2d-v5", "right_", "thigh_joint", +1, 0.1, 0.95, 0.04),
    ("Hopper-v5", "", "thigh_joint", +1, 0.065, 0.95, 0.04),
    ("HalfCheetah-v5", "back_", "bthigh", -1, 0.16 - 0.28 + 0.03, 0.25 + 0.14 + 0.097, None),
    ("HalfCheetah-v5", "front_", "fthigh", -1, -0.14 + 0.13 + 0.045, 0.24 + 0.18 + 0.07, None),
    ("Humanoid-v5", "left_", "left_hip_y", -1, 0.0, None, None),
    ("Humanoid-v5", "right_", "right_hip_y", -1, 0.0, None, None),
]


@pytest.mark.parametrize(("name", "prefix", "hip", "sign", "ahead", "below", "height"), FEET)
def test_a_foot_is_where_the_leg_puts_it(robots, name, prefix, hip, sign, ahead, below, height):
    robot = robots[name]
    rest = robot.put()
    assert rest[f"{prefix}foot_x"] == pytest.approx(ahead, abs=0.011)
    forward, backward = (robot.put(**{hip: sign * angle})[f"{prefix}foot_x"] for angle in (0.4, -0.4))
    assert (forward + backward) / 2 == pytest.approx(rest[f"{prefix}foot_x"] * math.cos(0.4), abs=1e-6)
    length = (forward - backward) / 2 / math.sin(0.4)
    assert length == pytest.approx(below, abs=1e-6) if below else 0.7 < length < 0.9
    if height is not None:
        assert rest[f"{prefix}foot_height"] == pytest.approx(UP + height)
    higher = robot.put(up=UP + 0.3)[f"{prefix}foot_height"]
    assert higher - rest[f"{prefix}foot_height"] == pytest.approx(0.3)


@pytest.mark.parametrize(
    ("name", "prefix", "hip"), [each[:3] for each in FEET if each[0] in ("Walker2d-v5", "Hopper-v5")]
)
def test_the_line_from_hip_to_foot_turns_with_the_hip_and_against_the_torso(robots, name, prefix, hip):
    robot, leg = robots[name], f"{prefix}leg"
    rest = robot.put()
    assert rest[leg] == pytest.approx(math.atan2(rest[f"{prefix}foot_x"], 0.95), abs=1e-3)
    assert robot.put(**{hip: 0.4})[leg] == pytest.approx(rest[leg] + 0.4)
    assert robot.put(rooty=0.3)[leg] == pytest.approx(rest[leg] - 0.3)
    assert robot.put(velocities={hip: 0.7})[f"{leg}_velocity"] == pytest.approx(0.7)
    assert robot.put(velocities={"rooty": 0.7})[f"{leg}_velocity"] == pytest.approx(-0.7)


@pytest.mark.parametrize(("leg", "ahead", "aside"), [(leg, x, y) for leg, *_, x, y in ANT_LEGS])
def test_a_foot_of_the_ant_is_where_its_name_says_and_goes_where_the_hip_swings_it(robots, leg, ahead, aside):
    robot = robots["Ant-v5"]
    foot, number, swing = next(rest[:3] for name, *rest in ANT_LEGS if name == leg)
    rest = robot.put()
    assert ahead * rest[f"{leg}_foot_x"] > 0.1
    assert aside * robot.place(foot)[Y] > 0.1
    forward = robot.put(**{f"hip_{number}": swing * 0.3})
    assert forward[f"{leg}_foot_x"] > rest[f"{leg}_foot_x"] + 0.05
    turned = robot.put(quaternion=Rotation.from_euler("z", 0.7).as_quat(scalar_first=True))
    assert turned[f"{leg}_foot_x"] == pytest.approx(rest[f"{leg}_foot_x"])


@pytest.mark.parametrize("name", ROBOTS)
def test_the_share_of_feet_on_the_ground_is_that_of_their_contacts(robots, name):
    seen = rollout(robots[name], 300, scale=1.0)
    feet = [key for key in seen[0] if key.endswith("foot_contact")]
    shares = [sum(one[foot] for foot in feet) / len(feet) for one in seen]
    assert [one["feet_down"] for one in seen] == pytest.approx(shares)
    assert len({*shares}) > 1


@pytest.mark.parametrize("name", ROBOTS)
def test_the_height_of_a_foot_is_where_it_begins_to_touch(robots, name):
    """The simulator's own collision detection says when."""
    robot, margin = robots[name], MARGIN.get(name, 0.0)
    for key, height in robot.put().items():
        if key.endswith("foot_height"):
            contact = key.replace("height", "contact")
            assert robot.put(up=UP - height + margin + 0.002)[contact] == 0
            touching = robot.put(up=UP - height + margin - 0.002)
            assert touching[key] == pytest.approx(margin - 0.002)
            assert touching[contact] == 1


@pytest.mark.parametrize(
    ("name", "standing", "lifted", "pose"),
    [
        ("Walker2d-v5", "right_", "left_", {"leg_left_joint": -1.0}),
        ("Walker2d-v5", "left_", "right_", {"leg_joint": -1.0}),
        ("HalfCheetah-v5", "back_", "front_", {"fthigh": -0.8}),
        ("HalfCheetah-v5", "front_", "back_", {"bfoot": -0.4, "bthigh": -0.5}),
        ("Humanoid-v5", "right_", "left_", {"left_knee": -1.2}),
        ("Humanoid-v5", "left_", "right_", {"right_knee": -1.2}),
        ("Ant-v5", "front_left_", "back_right_", {"ankle_1": 1.0}),
        ("Ant-v5", "back_right_", "back_left_", {"ankle_3": -1.0}),
    ],
)
def test_the_foot_that_stands_is_the_one_in_contact(robots, name, standing, lifted, pose):
    robot = robots[name]
    height = robot.put(**pose)[f"{standing}foot_height"]
    seen = robot.put(up=UP - height - 0.002, **pose)
    assert seen[f"{lifted}foot_height"] > 0.01
    assert (seen[f"{standing}foot_contact"], seen[f"{lifted}foot_contact"]) == (1, 0)


def test_who_lies_on_the_torso_has_no_foot_on_the_ground(robots):
    robot = robots["Walker2d-v5"]
    legs_up = {"rooty": math.pi / 2, "thigh_joint": -1.0, "thigh_left_joint": -1.0}
    seen = robot.put(up=0.049 - 1.25, **legs_up)
    assert robot.data.ncon > 0
    assert seen["left_foot_contact"] == seen["right_foot_contact"] == 0


def rollout(robot, num_steps, seed=0, scale=0.5):
    """What is read along a rollout of random torques, at every small step of the simulator."""
    robot.env.reset(seed=seed)
    skip, robot.base.frame_skip = robot.base.frame_skip, 1
    robot.env.action_space.seed(seed)
    seen = [robot.read()]
    for _ in range(num_steps):
        robot.base.step(scale * robot.env.action_space.sample())
        seen.append(robot.read())
    robot.base.frame_skip = skip
    return seen


@pytest.mark.parametrize("name", ROBOTS)
def test_velocities_are_the_derivatives_of_what_they_say(robots, name):
    robot = robots[name]
    seen = rollout(robot, 150)
    derivatives = [signal for signal in signal_pack(name).signals if signal.derivative_of]
    assert len(derivatives) >= 5
    for signal in derivatives:
        position = np.array([values[signal.derivative_of] for values in seen])
        velocity = np.array([values[signal.name] for values in seen])
        difference = np.diff(position) / robot.model.opt.timestep
        between = (velocity[1:] + velocity[:-1]) / 2
        slack = np.abs(np.diff(velocity)) / 2 + 0.02 * np.abs(velocity[1:]) + 1e-3
        # Not where a foot hits the floor: there the velocity goes up and down within a step.
        assert np.mean(np.abs(difference - between) <= slack) > 0.9, signal.name
        assert np.abs(velocity).max() > 0.03, signal.name


@pytest.mark.parametrize("name", ROBOTS)
def test_on_the_way_feet_are_in_contact_where_they_are_low(robots, name):
    seen = rollout(robots[name], 400, seed=1)
    for key in (key for key in seen[0] if key.endswith("foot_contact")):
        contact = np.array([values[key] for values in seen])
        height = np.array([values[key.replace("contact", "height")] for values in seen])
        assert height[contact == 1].max() < MARGIN.get(name, 0.0) + 0.02
        assert height[contact == 0].min() > MARGIN.get(name, 0.0) - 0.02
        assert 0 < contact.mean() < 1


def test_positions_are_of_the_same_moment_as_angles(robots):
    """MuJoCo's own positions after a step are a small step older than its angles."""
    robot = robots["HalfCheetah-v5"]
    rollout(robot, 60)
    before, seen = robot.place("ffoot"), robot.read()
    mujoco.mj_forward(robot.model, robot.data)
    foot, hip = robot.place("ffoot"), robot.data.joint("fthigh").xanchor
    assert abs(foot - before).max() > 1e-3
    assert seen["front_foot_x"] == pytest.approx(foot[X] - hip[X])


@pytest.mark.parametrize("name", ROBOTS)
def test_reading_changes_nothing(robots, name):
    """Two robots under the same torques, one of which is watched, stay the same to the bit."""
    watched, alone = robots[name], Robot(name)
    for robot in (watched, alone):
        robot.env.reset(seed=5)
        robot.env.action_space.seed(5)
    for _ in range(30):
        action = watched.env.action_space.sample()
        (one, *_), (other, *_) = watched.env.step(action), alone.env.step(action)
        watched.read()
        np.testing.assert_array_equal(one, other)


@pytest.mark.parametrize("name", ROBOTS)
def test_a_motor_alone_gives_the_power_that_its_joint_takes_up(robots, name):
    """In the air, with one motor on: the generalised forces of the motors, times velocities, by MuJoCo."""
    robot = robots[name]
    robot.put()
    for motor in range(robot.model.nu):
        robot.data.ctrl[:] = 0.0
        robot.data.ctrl[motor] = -0.3
        robot.data.qvel[:] = 0.0
        joint = robot.model.actuator_trnid[motor, 0]
        robot.data.qvel[robot.model.jnt_dofadr[joint]] = 2.0
        mujoco.mj_forward(robot.model, robot.data)
        taken_up = robot.data.qfrc_actuator @ robot.data.qvel
        assert taken_up < -0.1
        assert robot.read()["power"] == pytest.approx(-taken_up)
    robot.data.ctrl[:] = 0.0
    mujoco.mj_forward(robot.model, robot.data)
    assert robot.read()["power"] == 0.0


@pytest.mark.parametrize("name", ROBOTS)
def test_who_falls_freely_gains_momentum_by_its_weight(robots, name):
    robot = robots[name]
    seen = robot.put()
    names = {robot.model.joint(i).name for i in range(robot.model.njnt)}
    axis = 2 if "root" in names else int(robot.model.joint("rootz").dofadr[0])
    # With everything else held, the generalised force of gravity on the vertical is the whole weight.
    assert robot.data.qfrc_bias[axis] == pytest.approx(seen["weight"])


@pytest.mark.parametrize("name", ROBOTS)
def test_every_signal_is_poked_above(name):
    hinges = {signal for robot, signal, *_ in HINGES if robot == name}
    feet = {prefix for robot, prefix, *_ in FEET if robot == name}
    poked = hinges | {f"{signal}_velocity" for signal in hinges}
    poked |= {f"{prefix}foot_{what}" for prefix in feet for what in ("x", "height", "contact")}
    if name in ("Walker2d-v5", "Hopper-v5"):
        poked |= {
            f"{prefix}{what}" for prefix in feet for what in ("shank", "sole", "load", "leg", "leg_velocity")
        }
    if name == "Ant-v5":
        feet = {f"{leg}_" for leg, *_ in ANT_LEGS}
        poked |= {f"{prefix}foot_{what}" for prefix in feet for what in ("x", "height", "contact")}
        poked |= {"torso_y", "leftward_speed", "roll", "roll_velocity", "yaw", "yaw_velocity"}
    poked |= {
        "feet_down",
        "power",
        "weight",
        "torso_x",
        "torso_height",
        "forward_speed",
        "vertical_speed",
        "pitch",
        "pitch_velocity",
    }
    if name == "Humanoid-v5":
        poked |= {"torso_y", "leftward_speed", "roll", "roll_velocity", "yaw", "yaw_velocity"}
        poked |= {f"{side}_{what}" for side in ("left", "right") for what in ("hip_rotation", "foot_y")}
        poked |= {f"{side}_hip_rotation_velocity" for side in ("left", "right")}
    assert poked == {signal.name for signal in signal_pack(name).signals}


@pytest.mark.parametrize(("side", "outwards"), [("left", +1), ("right", -1)])
def test_the_humanoids_feet_are_told_as_the_torso_heads(robots, side, outwards):
    """Turned about by any yaw, the feet are still as far ahead of the hips and to the left of them."""
    robot = robots["Humanoid-v5"]
    pose = {f"{side}_hip_x": -0.3, f"{side}_hip_y": -0.5}
    straight = robot.put(**pose)
    assert outwards * straight[f"{side}_foot_y"] > 0.15
    assert straight[f"{side}_foot_x"] > 0.3
    about = Rotation.from_euler("z", 2.0).as_quat(scalar_first=True)
    turned = robot.put(quaternion=about, **pose)
    for key in (f"{side}_foot_x", f"{side}_foot_y", f"{side}_foot_height"):
        assert turned[key] == pytest.approx(straight[key])


@pytest.mark.parametrize(
    ("name", "prefix", "suffix"),
    [("Walker2d-v5", "left_", "_left"), ("Walker2d-v5", "right_", ""), ("Hopper-v5", "", "")],
)
def test_shank_and_sole_lean_as_their_ends_say(robots, name, prefix, suffix):
    robot = robots[name]
    pose = {f"thigh{suffix}_joint": -0.5, f"leg{suffix}_joint": -0.7, f"foot{suffix}_joint": 0.3}
    for rooty in (-0.4, 0.6):
        seen = robot.put(rooty=rooty, **pose)
        knee, ankle = (robot.data.joint(f"{part}{suffix}_joint").xanchor for part in ("leg", "foot"))
        shank = math.atan2(knee[X] - ankle[X], knee[Z] - ankle[Z])
        assert seen[f"{prefix}shank"] == pytest.approx(shank, abs=1e-9)
        middle, half = robot.place(f"foot{suffix}_geom"), 0.1
        axis = robot.data.geom(f"foot{suffix}_geom").xmat.reshape(3, 3)[:, Z]
        heel, toe = sorted((middle - half * axis, middle + half * axis), key=lambda end: end[X])
        sole = math.atan2(heel[Z] - toe[Z], toe[X] - heel[X])
        assert seen[f"{prefix}sole"] == pytest.approx(sole, abs=1e-9)


def test_the_loads_of_the_feet_are_the_forces_that_the_simulator_puts_on_them(robots):
    """MuJoCo's own sums over contacts, body by body, are worked out apart from single contacts."""
    robot = robots["Walker2d-v5"]
    height = robot.put()["left_foot_height"]
    seen = robot.put(up=UP - height - 0.003, leg_left_joint=-0.02)
    mujoco.mj_rnePostConstraint(robot.model, robot.data)
    for prefix, body in (("left_", "foot_left"), ("right_", "foot")):
        upwards = robot.data.body(body).cfrc_ext[5]
        assert seen[f"{prefix}load"] == pytest.approx(upwards, rel=1e-6)
    assert max(seen["left_load"], seen["right_load"]) > 10
    assert robot.put()["left_load"] == 0


def test_contacts_and_loads_are_the_same_whether_read_alone_or_together():
    """Alone, a foot of which one contact presses is not asked for its others, nor how hard they press."""
    env, pack = gymnasium.make("Walker2d-v5"), signal_pack("Walker2d-v5")
    contacts, loads = (
        tuple(f"{side}_{name}" for side in ("left", "right")) for name in ("foot_contact", "load")
    )
    alone, heavy, both = (pack.row_reader(names) for names in (contacts, loads, (*contacts, *loads)))
    env.reset(seed=0)
    env.action_space.seed(0)
    seen = set()
    for _ in range(300):
        _, _, ended, _, _ = env.step(env.action_space.sample())
        row = both(env)
        assert alone(env) + heavy(env) == row
        assert [contact > 0 for contact in row[:2]] == [load > 0 for load in row[2:]]
        seen.add((row[:2], env.unwrapped.data.ncon))
        if ended:
            env.reset()
    assert {contacts for contacts, _ in seen} == {(0.0, 0.0), (0.0, 1.0), (1.0, 0.0), (1.0, 1.0)}
    assert any(number > sum(contacts) > 0 for contacts, number in seen), "a foot with two contacts"
    env.close()


def test_a_described_human_gait_can_be_read_of_the_walker(robots):
    behaviour = load_behaviour("perry-gait")
    read = signal_pack(robots["Walker2d-v5"].env).reader(robots["Walker2d-v5"].env, behaviour.signal_names)
    robots["Walker2d-v5"].put()
    assert behaviour.phase_at(read(None, {})) is None, "in the air it is in none of the phases"


FLOORS = {
    "a floor of another name": ('name="floor"', 'name="ground"'),
    "a box": (
        "<worldbody>",
        '<worldbody><geom name="block" type="box" pos="0 0 -0.1" size="9 9 0.2" conaffinity="1"/>',
    ),
    "a box that can move": (
        "<worldbody>",
        '<worldbody><body pos="0 0 0.1"><freejoint/>'
        '<geom type="box" size="9 9 0.1" mass="900" conaffinity="1"/></body>',
    ),
}


@pytest.mark.parametrize("what", FLOORS)
def test_a_foot_stands_on_whatever_is_not_the_robot(what, tmp_path):
    from pathlib import Path

    from gymnasium.envs.mujoco import mujoco_env

    path = Path(mujoco_env.__file__).parent / "assets" / "walker2d.xml"
    (tmp_path / "walker.xml").write_text(path.read_text().replace(*FLOORS[what], 1))
    env = gymnasium.make("Walker2d-v5", xml_file=str(tmp_path / "walker.xml"))
    base, read = env.unwrapped, signal_pack("Walker2d-v5").reader(env)
    env.reset(seed=0)
    base.data.qpos[:], base.data.qvel[:] = base.init_qpos, 0.0  # without the noise of a start
    mujoco.mj_forward(base.model, base.data)
    level = 0.0 if what == "a floor of another name" else 0.1 if what == "a box" else 0.2
    base.data.joint("rootz").qpos += level - read(None, {})["left_foot_height"] - 0.003
    mujoco.mj_forward(base.model, base.data)
    standing = read(None, {})
    assert standing["left_foot_contact"] == standing["right_foot_contact"] == 1
    assert standing["left_foot_height"] == pytest.approx(level - 0.003)
    mujoco.mj_rnePostConstraint(base.model, base.data)
    assert standing["left_load"] == pytest.approx(base.data.body("foot_left").cfrc_ext[5], rel=1e-6)
    base.data.joint("rootz").qpos += 0.1
    mujoco.mj_forward(base.model, base.data)
    assert read(None, {})["left_foot_contact"] == read(None, {})["left_load"] == 0
