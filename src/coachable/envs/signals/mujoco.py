"""The signals of Gymnasium's MuJoCo robots, found by the names of joints, bodies and geoms."""

from __future__ import annotations

from coachable.behaviours.predicates import Signal
from coachable.envs.signals.mujoco_probes import (
    X,
    Y,
    Z,
    attitude,
    attitude_rate,
    feet_down,
    foot_as_torso_heads,
    foot_contact,
    foot_from_hip,
    foot_height,
    foot_load,
    joint,
    joint_angle,
    joint_velocity,
    lean,
    leg_angle,
    leg_angle_velocity,
    motor_power,
    pitch,
    roll,
    torso,
    weight,
    yaw,
)
from coachable.envs.signals.probes import Probe, ReadingOf, angle, probe


def _foot(prefix: str, foot: str, ahead_of_hip: ReadingOf) -> tuple[Probe, ...]:
    return (
        probe(
            f"{prefix}foot_contact",
            "",
            "1 while it presses on what is not the robot, else 0",
            foot_contact(foot),
        ),
        probe(f"{prefix}foot_x", "m", "how far its middle is ahead of the hip", ahead_of_hip),
        probe(f"{prefix}foot_height", "m", "of its lowest point over the floor", foot_height(foot)),
    )


_TORSO = (
    probe("torso_x", "m", "where the torso is, forward from the start of the world", torso(X)),
    probe("torso_height", "m", "of the middle of the torso over the floor", torso(Z)),
)

_EFFORT = (
    probe("power", "W", "of all motors, what they brake counted as what they drive", motor_power),
    probe("weight", "N", "of the robot", weight),
)


def _on_feet(*feet: str) -> Probe:
    return probe(
        "feet_down", "", "share of the feet that press on what is not the robot, 0 to 1", feet_down(*feet)
    )


def _speeds(x: ReadingOf, z: ReadingOf) -> tuple[Probe, ...]:
    return (
        Probe(Signal("forward_speed", "m/s", "of the torso, along x", "torso_x"), x),
        Probe(Signal("vertical_speed", "m/s", "of the torso; positive while it rises", "torso_height"), z),
    )


_PLANAR = (
    *_TORSO,
    *_speeds(joint_velocity("rootx"), joint_velocity("rootz")),
    *angle("pitch", "positive: the torso leans forward", joint("rooty"), joint_velocity("rooty")),
)


def _leg(prefix: str, suffix: str) -> tuple[Probe, ...]:
    """A leg of the walker or the hopper."""
    return (
        *joint_angle(
            f"{prefix}hip", "positive: flexed, the thigh in front of the torso", f"thigh{suffix}_joint", 1
        ),
        *joint_angle(f"{prefix}knee", "positive: flexed, the shank behind", f"leg{suffix}_joint", -1),
        *joint_angle(f"{prefix}ankle", "positive: dorsiflexed, the toes up", f"foot{suffix}_joint", 1),
        *_foot(
            prefix,
            f"foot{suffix}_geom",
            foot_from_hip(f"foot{suffix}_geom", f"thigh{suffix}_joint", X),
        ),
        *angle(
            f"{prefix}leg",
            "of the line from hip to middle of the foot, from upright; positive while the foot is ahead",
            leg_angle(f"foot{suffix}_geom", f"thigh{suffix}_joint"),
            leg_angle_velocity(
                f"foot{suffix}_geom",
                f"thigh{suffix}_joint",
                f"leg{suffix}_joint",
                f"foot{suffix}_joint",
            ),
        ),
        probe(
            f"{prefix}load",
            "N",
            "force of the ground on the foot, upwards",
            foot_load(f"foot{suffix}_geom"),
        ),
        probe(
            f"{prefix}shank",
            "rad",
            "lean from upright; positive while the knee is ahead of the ankle",
            lean(f"thigh{suffix}_joint", f"leg{suffix}_joint"),
        ),
        probe(
            f"{prefix}sole",
            "rad",
            "pitch of the sole; positive while the heel is higher than the toe",
            lean(f"thigh{suffix}_joint", f"leg{suffix}_joint", f"foot{suffix}_joint"),
        ),
    )


def _cheetah_leg(prefix: str, letter: str) -> tuple[Probe, ...]:
    """A leg of the cheetah. It stands on bent legs, so its angles count from there."""
    parts = (("hip", "thigh"), ("knee", "shin"), ("ankle", "foot"))
    rest = "angle from how the model rests; positive: swings the {} forward"
    return (
        *(
            probe
            for name, part in parts
            for probe in joint_angle(f"{prefix}{name}", rest.format(part), f"{letter}{part}", -1)
        ),
        *_foot(prefix, f"{letter}foot", foot_from_hip(f"{letter}foot", f"{letter}thigh", X)),
    )


def _humanoid_leg(side: str) -> tuple[Probe, ...]:
    away = "outwards, away from the other leg"
    return (
        *joint_angle(f"{side}_hip", "positive: flexed, the thigh in front", f"{side}_hip_y", -1),
        *joint_angle(f"{side}_hip_abduction", f"positive: the thigh {away}", f"{side}_hip_x", -1),
        *joint_angle(f"{side}_hip_rotation", "positive: the toes inwards", f"{side}_hip_z", 1),
        *joint_angle(f"{side}_knee", "positive: flexed, the shank behind the thigh", f"{side}_knee", -1),
        *_foot(f"{side}_", f"{side}_foot", foot_as_torso_heads(f"{side}_foot", f"{side}_hip_y", X)),
        probe(
            f"{side}_foot_y",
            "m",
            "how far the middle of the foot is to the left of the hip of its leg",
            foot_as_torso_heads(f"{side}_foot", f"{side}_hip_y", Y),
        ),
    )


def _ant_leg(name: str, foot: str, number: int, swings_forward: int, bends: int) -> tuple[Probe, ...]:
    """A leg of the ant: a hip that swings it in the plane of the torso, and a joint that bends it."""
    hip = f"hip_{number}"
    return (
        *joint_angle(
            f"{name}_hip",
            "angle from how the model rests; positive: swings the leg forward",
            hip,
            swings_forward,
        ),
        *joint_angle(f"{name}_ankle", "positive: bent, the foot drawn in under it", f"ankle_{number}", bends),
        *_foot(f"{name}_", foot, foot_as_torso_heads(foot, hip, X)),
    )


WALKER_2D = (
    *_PLANAR,
    *_leg("left_", "_left"),
    *_leg("right_", ""),
    _on_feet("foot_left_geom", "foot_geom"),
    *_EFFORT,
)
"""Walker2d. Its hips go from −150° to 0: a thigh comes to the front only where the torso leans back."""

HOPPER = (*_PLANAR, *_leg("", ""), _on_feet("foot_geom"), *_EFFORT)
"""Hopper: the walker's signals with one leg, so without left and right."""

HALF_CHEETAH = (
    *_PLANAR,
    *_cheetah_leg("back_", "b"),
    *_cheetah_leg("front_", "f"),
    _on_feet("bfoot", "ffoot"),
    *_EFFORT,
)
"""HalfCheetah: a back and a front leg."""

_FREE = (
    *_TORSO,
    probe("torso_y", "m", "where the torso is, to the left of the start of the world", torso(Y)),
    *_speeds(joint_velocity("root", offset=X), joint_velocity("root", offset=Z)),
    Probe(
        Signal("leftward_speed", "m/s", "of the torso, along y", "torso_y"),
        joint_velocity("root", offset=Y),
    ),
    *angle("roll", "positive: the torso leans to the right", attitude(roll), attitude_rate(0)),
    *angle("pitch", "positive: the torso leans forward", attitude(pitch), attitude_rate(1)),
    *angle("yaw", "positive: turned left, from facing along x", attitude(yaw), attitude_rate(2)),
)
"""A torso that is free in space."""

HUMANOID = (
    *_FREE,
    *_humanoid_leg("left"),
    *_humanoid_leg("right"),
    _on_feet("left_foot", "right_foot"),
    *_EFFORT,
)
"""Humanoid: torso and legs; it has no ankles, and its arms and waist are left out."""

ANT = (
    *_FREE,
    *_ant_leg("front_left", "left_ankle_geom", 1, swings_forward=-1, bends=+1),
    *_ant_leg("front_right", "fourth_ankle_geom", 4, swings_forward=+1, bends=+1),
    *_ant_leg("back_left", "right_ankle_geom", 2, swings_forward=-1, bends=-1),
    *_ant_leg("back_right", "third_ankle_geom", 3, swings_forward=+1, bends=-1),
    _on_feet("left_ankle_geom", "fourth_ankle_geom", "right_ankle_geom", "third_ankle_geom"),
    *_EFFORT,
)
"""Ant, each leg by where it is: what the model calls `front_right_leg` is at the back on the left."""
