"""What the checker proves is so, and what is not so it does not prove."""

import ast
import functools
import json
import sys

import numpy as np
import pytest
from scipy.integrate import solve_ivp

from tests.plants import oracle
from tests.verification.certificate import simulator
from tests.verification.certificate.alone import PATH, checker
from tests.verification.certificate.claims import STEP, certificate, changed

RNG = np.random.default_rng(11)


def starts_in(data, count):
    """Points of a certificate's box, uniformly, and their coordinates ξ; its corners are among them."""
    radii = np.array(data["box"]["radii"])
    xi = RNG.uniform(-1, 1, size=(3, count))
    xi[:, :8] = np.array(np.meshgrid(*[[-1, 1]] * 3)).reshape(3, -1)
    xi *= radii[:, None]
    return np.array(data["box"]["centre"])[:, None] + np.array(data["box"]["basis"]) @ xi, xi


def coordinates(data, y):
    """ξ of points y."""
    return np.linalg.solve(np.array(data["box"]["basis"]), y - np.array(data["box"]["centre"])[:, None])


def images_of(data, y):
    """Where starts are after all strides of the claim, in coordinates ξ, and the times of the last."""
    torque, held = simulator.controller(data["controller"])
    for _ in range(data["strides"]):
        y, when = simulator.stride(y, torque, held, float(data["method"]["step"]))
    return coordinates(data, y), when


def test_the_simulator_agrees_with_scipys_dop853(gait):
    y, basis, torque, held = gait
    data = certificate(y, basis, 3e-3, held=held)
    starts, _ = starts_in(data, 9)
    ours, when = simulator.stride(starts[:, 5:], torque, held, float(STEP))

    def u(x):
        first, second = torque(x)
        return np.array([first + second, -second])

    for k, start in enumerate(starts[:, 5:].T):
        x, t = np.array([start[0], -start[0], start[1], start[2]]), 0.0
        while True:
            now = u(x)
            solution = solve_ivp(
                lambda t, x, now=now: oracle.flow(t, x, now if held else u(x)),
                (0, float(STEP)),
                x,
                "DOP853",
                events=lambda t, x: x[0] + x[1] if x[1] > x[0] and t > 1e-9 else 1.0,
                rtol=1e-12,
                atol=1e-13,
            )
            crossings = [z for z in solution.y_events[0] if z[2] + z[3] < 0]
            if crossings:
                x, t = crossings[0], t + solution.t_events[0][-1]
                break
            x, t = solution.y[:, -1], t + float(STEP)
        assert ours[:, k] == pytest.approx(oracle.impact(x)[[0, 2, 3]], abs=1e-9)
        assert when[k] == pytest.approx(t, abs=1e-10)


def test_a_small_box_is_proven_and_its_images_are_where_the_proof_says(gait):
    y, basis, _, held = gait
    data = certificate(y, basis, 1e-4, held=held)
    fractions = []
    verdict = checker.check(data, fractions.append)
    assert verdict.proven, verdict.reason
    assert verdict.reason.startswith("proven: ")
    starts, _ = starts_in(data, 10_000)
    xi, when = images_of(data, starts)
    reached = np.max(np.abs(xi), axis=1) / 1e-4
    assert np.all(reached <= verdict.reach)
    assert np.all(reached > 0.7 * np.array(verdict.reach) - 0.1)
    assert verdict.stride_time[0] <= when.min() < when.max() <= verdict.stride_time[1]
    assert fractions == sorted(fractions)
    assert 0 <= fractions[0] < fractions[-1] <= 1
    for number in ("9.807", "-0.07", "0.0001", repr(float(y[0])), repr(float(basis[0][0]))):
        assert number in verdict.claim
    assert (f"every {STEP} s" in verdict.claim) == held


def wrong(y, basis):
    """Claims that are false or cannot be shown, by what is wrong with them."""
    good = certificate(y, basis, 1e-4, cuts=1)
    radius = ("box", "radii", [1e-5] * 3)
    return {
        "a shifted centre": changed(good, "box", "centre", list(y + np.array([2e-4, 0, 0]))),
        "too large a box": changed(good, "box", "radii", [0.03] * 3),
        "a box beyond all walking": changed(good, "box", "radii", [1.0] * 3),
        "another gravity": changed(changed(good, *radius), "plant", "gravity", "9.808"),
        "another mass": changed(changed(good, *radius), "plant", "leg_mass", "0.5001"),
        "another clock": changed(changed(good, *radius), "controller", "hold", None),
        "no walker": changed(good, "box", "centre", [0.3, 0.5, 0.0]),
    }


@pytest.mark.parametrize("what", wrong(np.zeros(3), np.eye(3)))
def test_what_is_wrong_is_not_proven(held_gait, what):
    y, basis, _ = held_gait
    verdict = checker.check(wrong(y, basis)[what])
    assert not verdict.proven
    assert verdict.reason.startswith("not a proof: ")


def test_an_unstable_gait_is_not_proven():
    torque = simulator.virtual_gravity(-0.085)
    y, jacobian = simulator.fixed_point(torque, True, np.array([0.3197, -1.1679, -0.0698]), float(STEP))
    assert np.max(np.abs(np.linalg.eigvals(jacobian))) > 1
    data = certificate(y, simulator.eigenbasis(jacobian), 1e-6, slope="-0.085", cuts=1)
    verdict = checker.check(data)
    assert not verdict.proven
    assert max(verdict.reach) > 1


def landings_of(data):
    loop, box, _, numbers, _ = checker.read(data)
    return loop, box, [(sets, loop.stride(sets, box, lambda k: None)) for sets in box.cut(numbers)]


def within(interval, numbers, slack):
    return (interval.lo - slack <= numbers) & (numbers <= interval.hi + slack)


def test_starts_that_touch_down_before_and_behind_a_sample_are_both_followed(held_gait):
    # The hold is tuned until the fixed point's touchdown falls on the 37th sample, half of the box before it.
    torque, hold, y = held_gait[2], 0.0202, held_gait[0]
    for _ in range(6):
        y, jacobian = simulator.fixed_point(torque, True, y, hold)
        _, when = simulator.stride(y[:, None], torque, True, hold)
        hold += (when[0] - 37 * hold) / 37
    text = f"{hold:.12f}"
    data = certificate(y, simulator.eigenbasis(jacobian), 1e-5, hold=text, cuts=1)
    _, _, [(_, landings)] = landings_of(data)
    assert len(landings) == 2
    starts, offsets = starts_in(data, 300)
    xi, when = images_of(data, starts)
    early = when < 37 * float(text)
    assert 50 < early.sum() < 250
    for ((z, J0, _, J, r), time), mine in zip(landings, (early, ~early), strict=True):
        at = z + checker.dot(J0, checker.point(offsets[:, mine])) + checker.dot(J, r)
        assert np.all(within(at, xi[:, mine], 1e-11))
        assert np.all(within(time, when[mine], 1e-11))


def test_every_start_lands_where_its_own_enclosure_says(gait):
    y, basis, _, held = gait
    data = certificate(y, basis, 1e-3, held=held, cuts=1)
    _, _, [(_, landings)] = landings_of(data)
    starts, offsets = starts_in(data, 500)
    xi, when = images_of(data, starts)
    found = np.zeros(500, bool)
    for (z, J0, _, J, r), time in landings:
        at = z + checker.dot(J0, checker.point(offsets)) + checker.dot(J, r)
        found |= np.all(within(at, xi, 1e-11), axis=0) & within(time, when, 1e-11)
    assert found.all()


def test_two_strides_in_one_claim(held_gait):
    y, basis, _ = held_gait
    data = changed(certificate(y, basis, 1e-6, strides=2, cuts=1), "method", "order", 9)
    verdict = checker.check(data)
    assert verdict.proven, verdict.reason
    starts, _ = starts_in(data, 200)
    xi, _ = images_of(data, starts)
    assert np.all(np.max(np.abs(xi), axis=1) / 1e-6 <= verdict.reach)
    assert "touches down 2 time(s)" in verdict.claim


def test_sub_boxes_leave_nothing_out(held_gait):
    y, basis, _ = held_gait
    _, box, _, _, _ = checker.read(certificate(y, basis, 0.1))
    batches = list(box.cut((3, 7, 60)))
    r0 = checker.join(*(sets.r0 for sets in batches), axis=1)
    volume = np.prod(r0.hi - r0.lo, axis=0).sum()
    assert len(r0.lo[0]) == 3 * 7 * 60
    assert volume == pytest.approx(0.2**3, rel=1e-12)
    assert np.all(r0.lo < 0)
    assert np.all(r0.hi > 0)
    for sets in batches:
        assert np.all(np.abs(sets.hull.lo[0] + sets.hull.hi[1]) < 1e-13)


@pytest.mark.parametrize(
    ("path", "value"),
    [
        (("plant", "gravity"), 9.807),
        (("plant",), {}),
        (("controller", "kind"), "constant"),
        (("controller", "slope"), None),
        (("controller", "hold"), "0.01"),
        (("controller",), {"kind": "network", "hold": None}),
        (("box", "centre"), [0.3, float("nan"), 0.0]),
        (("box", "centre"), [0.3, 0.0]),
        (("box", "basis"), [[1.0, 0.0, 0.0]] * 3),
        (("strides",), 0),
        (("strides",), True),
        (("method", "order"), 2.5),
        (("method", "step"), "-0.01"),
        (("method", "subdivisions"), [1, 1]),
        (("method", "subdivisions"), [1, 1, 10**9]),
        (("box",), None),
        (("plant", "hip_mass"), "-1.0"),
        (("plant", "leg_mass"), "0"),
        (("plant", "gravity"), "-9.807"),
        (("plant", "gravity"), "٩"),
        (("plant", "foot_radius"), "0.1"),
        (("controller", "damping"), "0.3"),
        (("controller", "slope"), "1.6"),
        (("box", "shape"), "ellipsoid"),
        (("method", "rounding"), "none"),
        (("box", "centre"), [0.3, 2**1024, 0.0]),
        (("box", "centre"), [0.3, -(2**1024), 0.0]),
        (("box", "centre"), [2**53 + 1, 0.0, 0.0]),
        (("box", "centre"), ["0.3", "-1.1", "-0.2"]),
        (("box", "radii"), [True, True, True]),
        (("method", "order"), 10**400),
        (("strides",), "1"),
        (("box", "centre"), functools.reduce(lambda inside, _: [inside], range(60), 0.3)),
    ],
)
def test_what_is_no_certificate_is_refused(held_gait, path, value):
    y, basis, _ = held_gait
    with pytest.raises(checker.CertificateError):
        checker.check(changed(certificate(y, basis, 1e-4), *path, value))


@pytest.mark.parametrize(
    ("key", "value"),
    [
        ("shift", [0.0] * 4),
        ("bound", 10.0),
        ("low", [0.0, 0.1]),
        ("high", [0.0, 2**1024]),
        ("low", ["-2.0", "-2.0"]),
        ("squashing", "relu"),
        ("biases", [[0.0, 0.0]]),
        ("biases", np.float64(0.0)),
    ],
)
def test_a_network_that_says_more_or_other_than_is_proven_is_refused(held_gait, key, value):
    y, basis, _ = held_gait
    network = {
        "kind": "network",
        "hold": STEP,
        "squashing": "clip",
        "low": [-2.0, -2.0],
        "high": [0.0, 0.0],
        "weights": [[[0.0] * 4] * 3, [[0.0] * 3] * 2],
        "biases": [[0.0] * 3, [0.0] * 2],
    }
    data = changed(certificate(y, basis, 1e-4), "controller", network)
    assert checker.read(data)
    with pytest.raises(checker.CertificateError):
        checker.read(changed(data, "controller", key, value))


def test_a_box_without_extent_is_not_proven(held_gait):
    y, basis, _ = held_gait
    for radii in ([1e-4, 0.0, 1e-4], [1e-4, -1e-4, 1e-4]):
        assert not checker.check(changed(certificate(y, basis, 1e-4), "box", "radii", radii)).proven


def test_arithmetic_that_takes_subnormal_numbers_for_zero_proves_nothing(held_gait):
    torch = pytest.importorskip("torch", reason="needs the [sb3] extra: pip install 'coachable[sb3]'")
    y, basis, _ = held_gait
    data = certificate(y, basis, 1e-4)
    torch.set_flush_denormal(True)
    try:
        verdict = checker.check(data)
    finally:
        torch.set_flush_denormal(False)
    assert not verdict.proven
    assert "IEEE 754" in verdict.reason


def test_a_certificate_survives_json(held_gait):
    y, basis, _ = held_gait
    data = certificate(y, basis, 1e-4)
    ours, theirs = (checker.read(d)[1] for d in (data, json.loads(json.dumps(data))))
    assert np.array_equal(ours.lift.lo, theirs.lift.lo)
    assert np.array_equal(ours.state.lo, theirs.state.lo)


def test_the_checker_is_one_short_file_that_imports_nothing_of_this_package():
    source = PATH.read_text(encoding="utf-8")
    imported = set()
    for node in ast.walk(ast.parse(source)):
        if isinstance(node, ast.Import):
            imported |= {alias.name.split(".")[0] for alias in node.names}
        elif isinstance(node, ast.ImportFrom):
            imported.add((node.module or ".").split(".")[0])
    assert imported - sys.stdlib_module_names == {"ival", "numpy"}
    assert len(source.splitlines()) <= 550
