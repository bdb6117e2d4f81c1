"""The audit of a reward: closed forms, an oracle for its graph problem, and its runs replayed."""

import dataclasses
from pathlib import Path

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy.optimize import linprog

from coachable import cli
from coachable.behaviours import Dwell, load_behaviour
from coachable.behaviours.checking.solver import smt
from coachable.behaviours.predicates import All, Any, Not
from coachable.foundation.errors import ParameterError
from coachable.rewards.audit import audit, possible_moves
from coachable.rewards.described_reward import DescribedReward
from coachable.rewards.forms import Schedule, Stay
from coachable.rewards.mean_cycles import Graph, maximum_mean_cycle

WALKING = load_behaviour("compass-walking")
TIMED = load_behaviour("compass-walking-timed")
DT = 0.01


def limited(limits):
    """Walking with these limits [s]."""
    phases = (
        dataclasses.replace(phase, dwell=Dwell(at_most=limit))
        for phase, limit in zip(WALKING.phases, limits, strict=True)
    )
    return dataclasses.replace(WALKING, phases=tuple(phases))


def means(behaviour, form, dt=DT):
    return {exploit.kind: exploit.mean for exploit in audit(behaviour, form, dt).exploits}


@pytest.mark.parametrize("limits", [(0.2, 0.2, 0.15, 0.2), (0.05, 0.3, 0.1, 0.15)])
def test_what_the_schedule_leaves_open_has_a_closed_form(limits):
    """For a simple cycle, φ = 1 and dt → 0; L is the sum of the limits, o the phase before p."""
    found, whole = means(limited(limits), Schedule(1.0)), sum(limits)
    for index, (name, limit) in enumerate(zip(WALKING.phase_names, limits, strict=True)):
        jumped, waited = (whole - 2 * limit) / (whole - limit), (whole - 2 * limit) / whole
        camped = (2 * limit - whole) / (whole - limits[index - 1])
        assert found[f"never enters {name}"] == pytest.approx(max(jumped, waited), abs=2 * DT / whole)
        assert found[f"stays in {name}"] == pytest.approx(camped, abs=2 * DT / (whole - limits[index - 1]))
    assert found["anything"] == 1


def test_without_a_fine_a_phase_is_passed_over_for_one_sample():
    found = means(TIMED, Schedule(0.0))
    for name, least in zip(WALKING.phase_names, (54, 54, 60, 54), strict=True):
        assert found[f"never enters {name}"] == pytest.approx((least - 0) / (least + 2), abs=0.01)


def test_a_fine_that_is_spread_leaves_no_more_open():
    behaviour = limited((0.05, 0.06, 0.03, 0.04))
    spread, at_once = (means(behaviour, Schedule(1.0, fine_spread=each)) for each in (True, False))
    assert spread == pytest.approx(at_once)


def test_what_the_papers_forms_leave_open():
    stay, equation = means(WALKING, "stay"), means(WALKING, "equation")
    assert set(stay.values()) == {1.0}
    assert {equation[f"stays in {name}"] for name in WALKING.phase_names} == {-1.0}
    assert {equation[f"never enters {name}"] for name in WALKING.phase_names} == {0.5}
    assert equation["never goes round"] == pytest.approx(0.6)


def test_a_limit_under_stay_is_undone_by_a_phase_left_out():
    found = means(TIMED, "stay")
    assert {found[f"stays in {name}"] for name in TIMED.phase_names} == {-1.0}
    for name in TIMED.phase_names:
        assert 0.96 < found[f"never enters {name}"] < 0.98
    # Without flicker, a sample outside undoes a limit.
    assert means(TIMED, Stay(flicker=0.0))["never enters O2"] > 0.9


def state_at(place):
    """Signals of a robot at a location."""
    phases = [phase.predicate for phase in WALKING.phases]
    inside = phases[place] if place < len(phases) else All()
    earlier = phases[:place]
    found = smt.witness(WALKING.signal_names, All(inside, Not(Any(*earlier))) if earlier else inside)
    assert isinstance(found, dict)
    return np.array([found[name] for name in WALKING.signal_names])


@pytest.mark.parametrize(
    "form", ["stay", "equation", "released", Schedule(0.4), Schedule(1.0), Schedule(1.0, fine_spread=True)]
)
def test_the_runs_earn_what_is_said_of_them(form):
    behaviour = limited((0.05, 0.06, 0.03, 0.04))
    reward, names = DescribedReward(behaviour, form, DT), [*behaviour.phase_names, "outside"]
    state = {name: state_at(place) for place, name in enumerate(names)}
    for exploit in audit(behaviour, form, DT).exploits:
        approach = [name for name, samples in exploit.approach.stays for _ in range(samples)]
        period = [name for name, samples in exploit.period.stays for _ in range(samples)]
        memory, rounds = reward.init(state[approach[0]]), []
        for name in approach[1:]:
            memory, _, _ = reward.step(memory, state[name])
        for name in 3 * period:
            memory, paid, info = reward.step(memory, state[name])
            assert names[int(info.phase)] == name
            rounds.append(float(paid))
        assert np.mean(rounds) == pytest.approx(exploit.mean)
        if exploit.kind.startswith("never enters "):
            assert exploit.kind.split()[-1] not in approach + period


@pytest.mark.parametrize("form", ["stay", Schedule(1.0)])
def test_no_run_at_random_earns_more(form):
    behaviour, rng = limited((0.05, 0.06, 0.03, 0.04)), np.random.default_rng(0)
    found = means(behaviour, form)
    reward = DescribedReward(behaviour, form, DT)
    without = 1  # O2
    states = np.array([state_at(place) for place in range(5) if place != without])
    memory, total = reward.init(np.tile(states[0], (200, 1))), 0.0
    for _ in range(400):
        memory, paid, _ = reward.step(memory, states[rng.choice(4, 200, p=[0.3, 0.3, 0.3, 0.1])])
        total = total + paid
    assert np.max(total) / 400 <= found["never enters O2"] + 0.05


EDGES = st.lists(st.tuples(st.integers(0, 5), st.integers(0, 5), st.integers(-4, 4)), min_size=1, max_size=15)


@settings(max_examples=60)
@given(EDGES)
def test_the_greatest_mean_is_that_of_a_linear_program(edges):
    """The greatest mean of a circulation: the dual of the maximum mean cycle (Karp, 1978)."""
    for node in {target for _, target, _ in edges}:
        if not any(source == node for source, _, _ in edges):
            edges = [*edges, (node, node, -9)]
    source, target, weight = np.array(sorted(edges), int).T
    cycle = maximum_mean_cycle(source, target, weight.astype(float))
    assert np.array_equal(target[cycle], source[np.roll(cycle, -1)])
    balance = np.array([(source == node) * 1.0 - (target == node) for node in range(6)])
    program = linprog(
        -weight,
        A_eq=np.vstack([balance, np.ones(len(weight))]),
        b_eq=[*np.zeros(6), 1.0],
        bounds=(0, None),
    )
    assert weight[cycle].mean() == pytest.approx(-program.fun, abs=1e-7)


def test_moves_that_the_description_rules_out_do_not_count():
    moves = possible_moves(WALKING)
    place = WALKING.phase_names.index
    assert moves[place("O4"), place("O1")]  # the touchdown
    assert moves[-1].all()
    assert moves[:, -1].all()
    # While the swing leg swings forward, it does not come to trail.
    assert not moves[place("O2"), place("O1")]


def test_the_command_shows_forms_side_by_side_and_says_what_cannot_be_paid(capsys):
    page = Path(__file__).parents[2].joinpath("docs", "audit.md").read_text(encoding="utf-8")
    for name in ("compass-walking", "compass-walking-timed"):
        cli.main(["audit", name])
        shown, _, reason = capsys.readouterr().out.partition("\nNot ")
        assert f"$ coachable audit {name}\n{shown.rstrip()}\n```" in page
        assert reason.startswith("schedule: ") == (name == "compass-walking")
    cli.main(["audit", "compass-walking-timed", "--form", "schedule"])
    assert "stays in O1          -0.62   O1 × 56" in capsys.readouterr().out


@pytest.mark.parametrize(
    ("options", "message"), [({"form": "sched"}, "schedule"), ({"form": "stay", "dt": 0.0}, "dt")]
)
def test_what_cannot_be_audited_is_refused(options, message):
    with pytest.raises(ParameterError, match=message):
        audit(TIMED, **options)


@settings(max_examples=60)
@given(EDGES, st.floats(0.02, 0.9), st.sampled_from([1, -1]))
def test_the_greatest_mean_at_a_rate_is_that_of_a_linear_program(edges, rate, sign):
    """Every third edge completes a round; runs that do so often, or seldom, enough."""
    edges = np.array(sorted({*edges, *((node, (node + 1) % 6, -2) for node in range(6))}), int)
    source, target, weight = edges.T
    round_ = np.arange(len(edges)) % 3 == 0
    graph = Graph(("A",), np.zeros((6, 1)), 1, source, target, weight.astype(float), ~round_)
    found = graph.best_at_rate("", rate, sign)
    balance = np.array([(source == node) * 1.0 - (target == node) for node in range(6)])
    program = linprog(
        -weight,
        A_ub=sign * round_[None] * 1.0,
        b_ub=[sign * rate],
        A_eq=np.vstack([balance, np.ones(len(weight))]),
        b_eq=[*np.zeros(6), 1.0],
        bounds=(0, None),
    )
    if found is None:
        assert program.status == 2
    else:
        assert found.mean == pytest.approx(-program.fun, abs=1e-6)
        if found.beside is not None:
            assert found.share + found.beside.share == pytest.approx(1)


def test_slower_or_faster_than_it_should_is_bounded_by_either_end():
    for form in ("stay", "equation", Schedule(1.0)):
        found = means(TIMED, form)
        at = {e.kind: e for e in audit(TIMED, form, DT, slower=0.9, faster=0.04).exploits}
        seldom, often = at["goes round in more than 0.9 s"], at["goes round in less than 0.04 s"]
        assert found["never goes round"] - 1e-9 <= seldom.mean <= found["anything"] + 1e-9
        assert often.mean <= found["anything"] + 1e-9
    with pytest.raises(ParameterError, match="slower"):
        audit(TIMED, "stay", slower=0.0)
    with pytest.raises(ParameterError, match="no cycle to go round"):
        audit(dataclasses.replace(WALKING, edges=WALKING.edges[:2], cycles=()), "stay", faster=1.0)
