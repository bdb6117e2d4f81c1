"""A certificate's file says what was written, or is refused; the ones that ship are about what they say."""

import dataclasses
import json
from itertools import pairwise
from pathlib import Path

import jax
import jax.numpy as jnp
import numpy as np
import pytest

from coachable.foundation.errors import ParameterError, RunFolderError
from coachable.learning.policy import Policy
from coachable.plants.compass import STATE_NAMES, CompassParameters, CompassWalker, VirtualGravity
from coachable.plants.controllers import ConstantTorque
from coachable.verification.certificate import checker, proposal
from coachable.verification.certificate.file import (
    PARTS,
    controller_data,
    part_hash,
    plant_data,
    read_certificate,
    recheck,
    walker_data,
    write_certificate,
)
from coachable.verification.certificate.proposal import Attempt, Proposal, eigenbasis, propose, rounded
from coachable.verification.gait.closed_loop import ClosedLoop
from coachable.verification.gait.orbit import Orbit
from tests.verification.certificate import simulator
from tests.verification.certificate.alone import checker as alone
from tests.verification.certificate.claims import certificate

SHIPPED = sorted((Path(__file__).parents[3] / "docs" / "results" / "certificates").glob("*.json"))
RNG = np.random.default_rng(3)
NO_ORBIT = Orbit("touchdown", "none", 0, (), (0.0, 0.0, 0.0), 0.0, 0.0, 0.0, 0.0)


@pytest.fixture
def written(held_gait, tmp_path):
    y, basis, _ = held_gait
    path = tmp_path / "certificate.json"
    write_certificate(path, {"about": {"walker": "virtual-gravity"}, **certificate(y, basis, 1e-4)})
    return path


def numbers_in(data, path=()):
    """Every path that leads to a number or a text."""
    if isinstance(data, dict | list):
        for key, part in data.items() if isinstance(data, dict) else enumerate(data):
            yield from numbers_in(part, (*path, key))
    else:
        yield path, data


def test_a_written_certificate_is_read_back_and_proven_by_the_checker_alone(written):
    data = read_certificate(written)
    assert set(PARTS) < set(data)
    verdict = recheck(written)
    assert verdict.proven, verdict.reason
    assert repr(data["box"]["centre"][0]) in verdict.claim


def test_any_changed_number_is_noticed(written):
    data = json.loads(written.read_text())
    for path, value in numbers_in({name: data[name] for name in PARTS}):
        tampered = json.loads(written.read_text())
        inside = tampered
        for key in path[:-1]:
            inside = inside[key]
        other = {str: lambda v: f"{v}1", float: lambda v: np.nextafter(v, 9), int: lambda v: v + 1}
        inside[path[-1]] = other[type(value)](value)
        written.with_name("tampered.json").write_text(json.dumps(tampered))
        with pytest.raises(RunFolderError, match=f"its '{path[0]}' is another"):
            recheck(written.with_name("tampered.json"))


def test_a_changed_number_with_a_new_hash_is_another_claim(written):
    data = json.loads(written.read_text())
    data["box"]["radii"] = [0.2, 0.2, 0.2]
    data["sha256"]["box"] = part_hash(data["box"])
    written.write_text(json.dumps(data))
    verdict = recheck(written)
    assert not verdict.proven
    assert "[0.2, 0.2, 0.2]" in verdict.claim


@pytest.mark.parametrize(
    ("text", "says"),
    [
        ("{", "damaged"),
        ("[]", "damaged: it holds no object"),
        ("{}", "not a certificate"),
        ('{"format": "coachable certificate", "format_version": 9}', "format_version 9"),
        ('{"format": "coachable certificate", "format_version": 1}', "lacks 'about'"),
    ],
)
def test_what_is_no_certificate_is_refused_in_a_sentence(tmp_path, text, says):
    path = tmp_path / "no.json"
    path.write_text(text)
    with pytest.raises(RunFolderError, match=says):
        recheck(path)


def test_parts_that_make_no_sense_are_refused(written):
    data = json.loads(written.read_text())
    data["strides"] = 0
    data["sha256"]["strides"] = part_hash(0)
    written.write_text(json.dumps(data))
    with pytest.raises(RunFolderError, match="whole numbers"):
        recheck(written)


def test_numbers_laid_out_otherwise_are_refused(written):
    data = json.loads(written.read_text())
    data["box"]["basis"] = [number for row in data["box"]["basis"] for number in row]
    data["sha256"]["box"] = part_hash(data["box"])
    written.write_text(json.dumps(data))
    with pytest.raises(RunFolderError, match=r"shape \(3, 3\)"):
        recheck(written)


def test_a_certificate_of_another_walker_is_refused(written):
    plant = CompassWalker()
    mine = ClosedLoop(plant, VirtualGravity(plant), control_dt=0.02)
    assert recheck(written, mine).proven
    heavier = CompassWalker(CompassParameters(hip_mass=1.1))
    for other, part in (
        (ClosedLoop(heavier, VirtualGravity(heavier), control_dt=0.02), "plant"),
        (ClosedLoop(plant, VirtualGravity(plant, slope=-0.06), control_dt=0.02), "controller"),
        (ClosedLoop(plant, VirtualGravity(plant)), "controller"),
    ):
        with pytest.raises(RunFolderError, match=f"another walker: its {part}"):
            recheck(written, other)


def test_virtual_gravity_for_other_masses_than_it_drives_is_refused(written):
    plant = CompassWalker()
    for parameters in (CompassParameters(hip_mass=1.1), CompassParameters(gravity=9.81)):
        loop = ClosedLoop(plant, VirtualGravity(CompassWalker(parameters)), control_dt=0.02)
        with pytest.raises(ParameterError, match="virtual gravity for the walker that it drives"):
            recheck(written, loop)


@pytest.mark.parametrize(
    ("part", "key", "value"),
    [("plant", "hip_mass", "-1.0"), ("plant", "spring", "3.0"), ("controller", "shift", [0.0, 0.0])],
)
def test_a_claim_with_unknown_or_impossible_values_is_refused_whatever_its_hash(written, part, key, value):
    data = json.loads(written.read_text())
    data[part][key] = value
    data["sha256"][part] = part_hash(data[part])
    written.write_text(json.dumps(data))
    with pytest.raises(RunFolderError, match="damaged"):
        recheck(written)


def test_the_plants_constants_are_the_shortest_decimal_numbers():
    assert plant_data(CompassParameters(gravity=9.807, a=1e-5))["gravity"] == "9.807"
    assert plant_data(CompassParameters(gravity=9.807, a=1e-5))["a"] == "0.00001"


@pytest.fixture
def policy():
    sizes = [4, 8, 8, 2]
    layers = list(pairwise(sizes))
    return Policy(
        weights=tuple(jnp.asarray(RNG.normal(size=(n, k)), jnp.float32) for k, n in layers),
        biases=tuple(jnp.asarray(RNG.normal(size=n), jnp.float32) for _, n in layers),
        low=jnp.array([-2.0, -2.0], jnp.float32),
        high=jnp.array([0.0, 0.0], jnp.float32),
        observation_names=STATE_NAMES,
    )


def test_a_policys_single_precision_weights_are_kept_exactly(policy):
    data = json.loads(json.dumps(controller_data(ClosedLoop(CompassWalker(), policy))))
    for ours, weight in zip(data["weights"], policy.weights, strict=True):
        assert np.array_equal(np.array(ours), np.asarray(weight).astype(np.float64))
    x = RNG.normal(size=(4, 5))
    with jax.enable_x64(True):
        u = np.asarray(jax.vmap(policy)(jnp.asarray(x.T)))
    assert simulator.network(data)(x) == pytest.approx(np.stack([u[:, 0] + u[:, 1], -u[:, 1]]), abs=1e-6)


@pytest.mark.parametrize(
    ("changes", "named"),
    [
        ({"shift": jnp.zeros(4), "scale": jnp.ones(4)}, "shift, scale"),
        ({"shift": jnp.zeros(4), "scale": 2 * jnp.ones(4), "bound": 0.5}, "shift, scale"),
        ({"shift": jnp.ones(4)}, "shift"),
        ({"activation": "relu"}, "activation"),
        ({"observation_names": STATE_NAMES[::-1]}, "observation_names"),
        ({"observation_names": (*STATE_NAMES, "phase")}, "observation_names"),
    ],
)
def test_a_policy_that_is_more_than_its_numbers_has_no_certificate(policy, tmp_path, changes, named):
    plant = CompassWalker()
    path = tmp_path / "certificate.json"
    plain = ClosedLoop(plant, policy)
    box = {"centre": [0.3, -1.1, -0.2], "basis": np.eye(3).tolist(), "radii": [1e-4] * 3}
    method = {"order": 1, "step": "0.01", "subdivisions": [1] * 3}
    parts = {"about": {}, **walker_data(plain), "box": box, "strides": 1, "method": method}
    write_certificate(path, parts)
    assert not recheck(path, plain).proven
    other = ClosedLoop(plant, dataclasses.replace(policy, **changes))
    with pytest.raises(ParameterError, match=f"without this policy's {named};"):
        recheck(path, other)
    with pytest.raises(ParameterError, match=f"without this policy's {named};"):
        propose(other, NO_ORBIT, {})


def test_subclasses_move_otherwise_and_are_refused(policy):
    class Louder(Policy):
        pass

    class Bent(CompassWalker):
        pass

    louder = Louder(policy.weights, policy.biases, policy.low, policy.high)
    for loop in (ClosedLoop(CompassWalker(), louder), ClosedLoop(Bent(), policy)):
        with pytest.raises(ParameterError, match="certificate"):
            controller_data(loop)


def test_walkers_without_certificates_are_refused(policy):
    plant = CompassWalker()
    for loop in (
        ClosedLoop(plant, ConstantTorque((-1.35, -0.18))),
        ClosedLoop(plant, VirtualGravity(plant, released=True)),
        ClosedLoop(plant, policy, hold="continuous"),
        ClosedLoop(CompassWalker(backward_passing_counts=True), policy),
    ):
        with pytest.raises(ParameterError, match="certificate"):
            controller_data(loop)


def test_the_proposer_finds_a_box_that_the_checker_proves(held_gait, monkeypatch):
    monkeypatch.setattr(proposal, "MOST_ATTEMPTS", 2)
    monkeypatch.setattr(proposal, "ORDER", 9)  # steps are of 0.02 s
    y, basis, _ = held_gait
    plant = CompassWalker()
    nothing = float("nan")
    orbit = Orbit(
        "touchdown", "periodic", 1, (tuple(y.tolist()),), (0.0, 0.0, 0.0), nothing, nothing, nothing, nothing
    )
    fractions = []
    loop = ClosedLoop(plant, VirtualGravity(plant), control_dt=0.02)
    found = propose(loop, orbit, {}, subdivisions=2, progress=fractions.append)
    assert found.certificate is not None
    assert found.verdict is not None
    assert found.verdict.proven
    assert found.radius > 5e-5
    assert found.certificate["box"]["radii"] == [found.radius] * 3
    assert np.array(found.certificate["box"]["centre"]) == pytest.approx(y, abs=1e-7)
    assert np.array(found.certificate["box"]["basis"]) == pytest.approx(basis, abs=1e-5)
    assert fractions == sorted(fractions)
    out_of_time = propose(loop, orbit, {}, seconds=1e-9)
    assert out_of_time.certificate is None
    assert out_of_time.obstacle == "no time was left"


def test_the_largest_proven_box_is_taken():
    verdicts = {
        proven: checker.Verdict("", proven, "", (0.5, 0.5, 0.5), (0.7, 0.8), 1.0) for proven in (True, False)
    }
    attempts = tuple(Attempt(r, 1, verdicts[p]) for r, p in ((1e-5, True), (4e-3, True), (9e-3, False)))
    found = Proposal({}, attempts, (0.5 + 0j,), 2.0, "")
    assert found.radius == 4e-3
    assert found.verdict is verdicts[True]


def test_an_eigenbasis_turns_the_jacobian_into_blocks():
    jacobian = np.array([[0.1, -0.8, 0.3], [0.9, 0.2, 0.1], [0.0, 0.4, -0.3]])
    values, basis = eigenbasis(jacobian)
    blocks = np.linalg.solve(basis, jacobian @ basis)
    assert np.sort(np.abs(np.linalg.eigvals(blocks))) == pytest.approx(np.sort(np.abs(values)))
    size = max(abs(value.real) + abs(value.imag) for value in values)
    assert np.max(np.abs(blocks).sum(axis=1)) == pytest.approx(size)


def test_radii_are_rounded_down_to_two_digits():
    assert [rounded(r) for r in (0.00349, 9.99e-6, 0.02)] == [0.0034, 9.9e-6, 0.02]


@pytest.mark.parametrize("path", SHIPPED, ids=lambda path: path.stem)
def test_ten_thousand_starts_in_a_shipped_box_are_in_it_again(path):
    data = read_certificate(path)
    box = data["box"]
    xi = RNG.uniform(-1, 1, size=(3, 10_000))
    xi[:, :5000] /= np.max(np.abs(xi[:, :5000]), axis=0)  # on the box's faces
    xi *= np.array(box["radii"])[:, None]
    y = np.array(box["centre"])[:, None] + np.array(box["basis"]) @ xi
    torque, held = simulator.controller(data["controller"])
    for _ in range(data["strides"]):
        y, _ = simulator.stride(y, torque, held, float(data["method"]["step"]))
    after = np.linalg.solve(np.array(box["basis"]), y - np.array(box["centre"])[:, None])
    assert np.all(np.abs(after) < np.array(box["radii"])[:, None])


@pytest.mark.parametrize("path", SHIPPED[::2], ids=lambda path: path.stem)
def test_the_corners_of_a_shipped_box_are_proven(path):
    loop, box, strides, numbers, _ = alone.read(read_certificate(path))
    assert strides == 1
    assert float(np.min(box.radii.lo)) >= 3e-3
    first = next(iter(box.cut(numbers)))
    corners = alone.Sets(*(part[..., [0, numbers[2] - 1]] for part in first))
    for (z, J0, r0, J, r), _ in loop.stride(corners, box, lambda k: None):
        xi = z + alone.dot(J0, r0) + alone.dot(J, r)
        assert np.all(xi.mag <= box.radii.lo)
