"""The mirror image of a MuJoCo robot: which body, joint and motor is whose image, by its model's geometry.

The robot's pose at home is reflected at the plane between left and right, y → −y. A position is a vector; the
axis of a hinge and an angular velocity are pseudo-vectors, which a reflection turns the other way round.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from itertools import permutations, product
from typing import Any

import numpy as np
from jaxtyping import Float

from coachable.envs.symmetry.signed_permutation import SignedPermutation
from coachable.foundation.errors import ParameterError

REFLECTION = np.array([1.0, -1.0, 1.0])
"""Of a vector; of a pseudo-vector it is the negative."""
CLOSE = 1e-6
"""How far [m] an image may lie from what it is the image of, and how far axes may differ."""
MOST_MAPS = 1_000
"""Ways of pairing bodies that are looked at."""

_FREE, _BALL, _SLIDE, _HINGE = range(4)
_COMPARED: Mapping[str, tuple[str, ...]] = {
    "body": ("mass", "inertia"),
    "joint": ("range", "damping", "armature", "stiffness", "frictionloss", "margin"),
    "geom": ("type", "size", "friction", "condim", "contype", "conaffinity", "solref", "solimp", "margin"),
    "actuator": ("ctrlrange", "forcerange", "gear"),
}
"""What may differ between two sides, by the kind of part."""


@dataclass(frozen=True)
class MujocoMirror:
    """A reflection of a model's state and controls."""

    bodies: tuple[int, ...]
    """The image of every body, by index."""
    positions: SignedPermutation
    """Of qpos less its value at home."""
    home: Float[np.ndarray, " nq"]
    velocities: SignedPermutation
    controls: SignedPermutation

    def state(
        self, qpos: Float[np.ndarray, " nq"], qvel: Float[np.ndarray, " nv"]
    ) -> tuple[Float[np.ndarray, " nq"], Float[np.ndarray, " nv"]]:
        """The mirror image of a state."""
        return self.home + self.positions(qpos - self.home), self.velocities(qvel)

    @property
    def exchanges(self) -> bool:
        """Whether limbs change places; without that, to leave all as it is passes every test."""
        return any(image != body for body, image in enumerate(self.bodies))


@dataclass(frozen=True)
class Difference:
    """In what two parts that are each other's image differ."""

    kind: str
    names: tuple[str, str]
    places: tuple[int, int]
    field: str
    values: tuple[Any, Any]
    expected: Any
    """Of the second one, were it the first one's image."""

    @property
    def sentence(self) -> str:
        """Such as `joint right_knee and left_knee differ in stiffness: [0.] and [1.]`."""
        one, other = (np.array2string(np.asarray(value), precision=4) for value in self.values)
        return f"{self.kind} {' and '.join(self.names)} differ in {self.field}: {one} and {other}"


def mirrors_of(model: Any) -> tuple[MujocoMirror, ...]:
    """All ways in which a model's pose at home is its own mirror image, those that exchange most first.

    **Raises:** `ParameterError` for joints and motors of kinds that are not reflected here.
    """
    home = _Home(model)
    maps = []
    for bodies in _matched(home, 0, 0):
        maps.append(tuple(bodies[body] for body in range(model.nbody)))
        if len(maps) > MOST_MAPS:
            raise ParameterError(f"the robot has more than {MOST_MAPS} ways of being its own mirror image")
    found = [mirror for bodies in maps if (mirror := _mirror(home, bodies)) is not None]
    return tuple(sorted(found, key=lambda mirror: -sum(a != b for b, a in enumerate(mirror.bodies))))


def differences(model: Any, mirror: MujocoMirror) -> tuple[Difference, ...]:
    """What is not the same on both sides, though it is each other's image."""
    home = _Home(model)
    joints, actuators = home.joint_images(mirror.bodies), _actuator_images(home, mirror.bodies)
    images = {
        "body": dict(enumerate(mirror.bodies)),
        "joint": {joint: image for joint, (image, _) in joints.items()},
        "geom": _geom_images(home, mirror.bodies),
        "actuator": {actuator: image for actuator, (image, _) in actuators.items()},
    }
    signs = {("joint", joint): sign for joint, (_, sign) in joints.items()}
    signs |= {("actuator", actuator): sign for actuator, (_, sign) in actuators.items()}
    found = []
    for kind, fields in _COMPARED.items():
        for part, image in images[kind].items():
            if image <= part:
                continue
            for field in fields:
                one, other = (np.array(getattr(getattr(model, kind)(each), field)) for each in (part, image))
                expected = one
                if field == "gear":
                    expected = np.abs(one) * np.where(other < 0, -1, 1)  # which way it turns is known
                elif signs.get((kind, part)) == -1 and field.endswith("range"):
                    expected = -one[::-1]
                if not np.allclose(other, expected, rtol=1e-6, atol=1e-9):
                    first, second = (getattr(model, kind)(each).name or str(each) for each in (part, image))
                    found.append(
                        Difference(kind, (first, second), (part, image), field, (one, other), expected)
                    )
    return tuple(found)


def equal_sides(model: Any, found: Sequence[Difference]) -> None:
    """Make a model's two sides the same where they differ: the second one like the first.

    Its solver, too, which may take one contact after the other, is made one that takes them all at once.
    """
    mujoco = engine()
    for each in found:
        getattr(getattr(model, each.kind)(each.places[1]), each.field)[:] = each.expected
    if found:
        mujoco.mj_setConst(model, mujoco.MjData(model))
    model.opt.solver, model.opt.iterations, model.opt.tolerance = mujoco.mjtSolver.mjSOL_NEWTON, 200, 0.0


def engine() -> Any:
    """The simulator's package, whose bindings say nothing of what is in it."""
    import mujoco

    return mujoco


class _Home:
    """A model's pose at home."""

    def __init__(self, model: Any):
        mujoco = engine()
        self.model, data = model, mujoco.MjData(model)
        mujoco.mj_forward(model, data)
        self.anchors, self.axes = data.xanchor.copy(), data.xaxis.copy()
        self.centres, self.geoms = data.xipos.copy(), data.geom_xpos.copy()
        self.qpos = data.qpos.copy()

    def children(self, body: int) -> list[int]:
        return [b for b in range(1, self.model.nbody) if self.model.body_parentid[b] == body]

    def joints(self, body: int) -> range:
        first = int(self.model.body_jntadr[body])
        return range(first, first + int(self.model.body_jntnum[body])) if first >= 0 else range(0)

    def is_image(self, body: int, other: int) -> bool:
        """Whether a body's joints and centre of mass lie where another's are in the mirror."""
        if len(self.joints(body)) != len(self.joints(other)):
            return False
        signs = [self.sign(j, k) for j, k in zip(self.joints(body), self.joints(other), strict=True)]
        return all(signs) and _close(self.centres[body] * REFLECTION, self.centres[other])

    def sign(self, joint: int, other: int) -> int:
        """1 or −1 if a joint's image is another joint, turning the same way or the other; 0 if it is not."""
        kind = self.model.jnt_type[joint]
        if kind != self.model.jnt_type[other]:
            return 0
        if kind in (_FREE, _BALL):
            return int(joint == other)
        if kind == _HINGE and not _close(self.anchors[joint] * REFLECTION, self.anchors[other]):
            return 0
        axis = self.axes[joint] * REFLECTION * (-1 if kind == _HINGE else 1)
        return next((sign for sign in (1, -1) if _close(sign * axis, self.axes[other])), 0)

    def joint_images(self, bodies: tuple[int, ...]) -> dict[int, tuple[int, int]]:
        return {
            j: (k, self.sign(j, k))
            for body, image in enumerate(bodies)
            for j, k in zip(self.joints(body), self.joints(image), strict=True)
        }


def _matched(home: _Home, body: int, other: int) -> Iterator[dict[int, int]]:
    """Every way of making a body's limbs the images of another's."""
    if not home.is_image(body, other):
        return
    ours, theirs = home.children(body), home.children(other)
    if len(ours) != len(theirs):
        return
    possible = {(a, b): [*_matched(home, a, b)] for a in ours for b in theirs}
    for order in permutations(theirs):
        ways = [possible[pair] for pair in zip(ours, order, strict=True)]
        if not all(ways):
            continue
        for chosen in product(*ways):
            yield {body: other} | {a: b for part in chosen for a, b in part.items()}


def _mirror(home: _Home, bodies: tuple[int, ...]) -> MujocoMirror | None:
    """The reflection for a pairing of bodies; `None` if it is not one that undoes itself."""
    model = home.model
    if any(bodies[image] != body for body, image in enumerate(bodies)):
        return None
    positions, velocities = [(0, 1)] * model.nq, [(0, 1)] * model.nv
    for joint, (image, sign) in home.joint_images(bodies).items():
        (q, v), (of_q, of_v) = ((int(model.jnt_qposadr[j]), int(model.jnt_dofadr[j])) for j in (joint, image))
        if model.jnt_type[joint] == _FREE:
            for offset, own in enumerate((1, -1, 1, 1, -1, 1, -1)):
                positions[q + offset] = q + offset, own
            for offset, own in enumerate((1, -1, 1, -1, 1, -1)):
                velocities[v + offset] = v + offset, own
        elif model.jnt_type[joint] == _BALL:
            raise ParameterError(
                f"joint {model.joint(joint).name} is a ball joint, which is not reflected here"
            )
        else:
            positions[of_q], velocities[of_v] = (q, sign), (v, sign)
    controls = [(0, 1)] * model.nu
    for actuator, (image, sign) in _actuator_images(home, bodies).items():
        controls[image] = actuator, sign
    return MujocoMirror(
        bodies, _permutation(positions), home.qpos, _permutation(velocities), _permutation(controls)
    )


def _actuator_images(home: _Home, bodies: tuple[int, ...]) -> dict[int, tuple[int, int]]:
    """Which motor drives the image of what a motor drives, and whether it turns the same way."""
    model, joints, images = home.model, home.joint_images(bodies), {}
    driven = [int(model.actuator_trnid[actuator, 0]) for actuator in range(model.nu)]
    for actuator, joint in enumerate(driven):
        name = model.actuator(actuator).name or str(actuator)
        if model.actuator_trntype[actuator] != 0:
            raise ParameterError(f"motor {name} drives no joint, and is not reflected here")
        image, sign = joints[joint]
        if image not in driven:
            raise ParameterError(f"motor {name} has no partner: nothing drives {model.joint(image).name}")
        other = driven.index(image)
        gears = model.actuator_gear[actuator, 0] * model.actuator_gear[other, 0]
        images[actuator] = other, int(sign * np.sign(gears))
    return images


def _geom_images(home: _Home, bodies: tuple[int, ...]) -> dict[int, int]:
    """Of the geoms of limbs, the one of the image's body that lies where a geom is in the mirror."""
    model, images = home.model, {}
    for geom in range(model.ngeom):
        body = int(model.geom_bodyid[geom])
        if bodies[body] == body:
            continue
        others = [g for g in range(model.ngeom) if model.geom_bodyid[g] == bodies[body]]
        close = [g for g in others if _close(home.geoms[geom] * REFLECTION, home.geoms[g])]
        if close:
            images[geom] = close[0]
    return images


def _permutation(places: list[tuple[int, int]]) -> SignedPermutation:
    return SignedPermutation(tuple(source for source, _ in places), tuple(sign for _, sign in places))


def _close(one: np.ndarray, other: np.ndarray) -> bool:
    return bool(np.abs(one - other).max() < CLOSE)
