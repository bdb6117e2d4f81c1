"""A passport comes back from its file as it was, and a damaged one is refused with what is wrong."""

import csv
import io
import json
from dataclasses import replace

import pytest
from rich.console import Console

from coachable.foundation.errors import RunFolderError
from coachable.plants.compass import CompassWalker
from coachable.verification.gait.adherence import Adherence, Transition
from coachable.verification.gait.orbit import Orbit
from coachable.verification.gait.stability import Stability
from coachable.verification.passport.passport import (
    FallSearch,
    Orbits,
    Passport,
    Walker,
    passport_data,
    read_passport,
    write_passport,
)
from coachable.verification.passport.text import print_passport, write_summary
from coachable.verification.proportion import Proportion
from coachable.verification.robustness.basin import Basin
from coachable.verification.robustness.pushes import Pushes, Tolerance

NOTHING = float("nan")
GAIT = Orbit("touchdown", "periodic", 1, ((0.3, -1.1, -0.2),), (0.0, 0.0, 0.0), 0.75, 0.6, 0.07, 1e-15)
NONE = Orbit("free", "none", 0, (), (NOTHING, NOTHING, NOTHING), NOTHING, NOTHING, NOTHING, NOTHING)
PUSHES = Pushes((Tolerance("mass up", 0.5, 2.0, "of nominal"),), delay_survived=False)
WHOLE = Passport(
    walker=Walker("orthant-3", "orthant", 3, "last", "ab" * 32, "paper", "touchdown"),
    level="full",
    adherence=Adherence(
        behaviour="compass-walking",
        seconds=100.0,
        up=True,
        share_in_phases=0.9,
        phases={"O1": 0.9},
        transitions=(Transition("O1", None, 3, False),),
        cycles={"O1 → O1": 4},
        violations={"leaves all phases": 3},
        explained=("t = 0 s: so it is.",),
    ),
    orbits=Orbits(NONE, GAIT),
    stability=Stability(
        (-0.5 + 0.2j, -0.5 - 0.2j, 0.1 + 0j), (1e-7,) * 3, 5.0, 1e-9, 70, (30, 0), None, 1e-3
    ),
    basins=(Basin("start", Proportion(90, 100), Proportion(10, 100), Proportion(0, 100)),),
    pushes=PUSHES,
    baseline="virtual-gravity",
    baseline_pushes=PUSHES,
)


def damaged(path, change):
    data = json.loads(path.read_text(encoding="utf-8"))
    change(data)
    path.write_text(json.dumps(data), encoding="utf-8")
    with pytest.raises(RunFolderError) as refused:
        read_passport(path)
    return str(refused.value)


def test_a_passport_comes_back_as_it_was(tmp_path):
    path = write_passport(tmp_path, WHOLE)
    assert path == tmp_path / "orthant-3.json"
    again = read_passport(path)
    assert passport_data(again) == passport_data(WHOLE)
    assert again.stability == WHOLE.stability
    assert again.walker == WHOLE.walker
    assert [entry.name for entry in tmp_path.iterdir()] == ["orthant-3.json"]


def test_the_file_is_strict_json_and_gives_what_follows_from_its_numbers(tmp_path):
    def refuse(constant):
        raise AssertionError(constant)

    data = json.loads(write_passport(tmp_path, WHOLE).read_text(encoding="utf-8"), parse_constant=refuse)
    assert data["format_version"] == 1
    assert data["orbits"]["free"]["period"] is None
    assert data["orbits"]["touchdown"]["speed"] == pytest.approx(0.8)
    assert data["stability"]["verdict"] == "stable"
    assert data["basins"][0]["reached"]["share"] == 0.9


@pytest.mark.parametrize(
    ("change", "said"),
    [
        (lambda data: data.update(format_version=2), "format_version 2"),
        (lambda data: data.pop("stability"), "lacks 'stability'"),
        (lambda data: data["walker"].update(name=3), "walker.name must be text"),
        (lambda data: data["orbits"]["free"].update(kind="odd"), "orbits.free.kind must be one of"),
        (
            lambda data: data["orbits"]["touchdown"]["points"].append([1, "x"]),
            "points[1][1] must be a number",
        ),
        (lambda data: data["adherence"].update(up=1), "adherence.up must be true or false"),
        (lambda data: data["basins"][0]["reached"].update(count="many"), "count must be a whole number"),
        (lambda data: data.update(colour="red"), "unknown key 'colour'"),
    ],
)
def test_a_damaged_file_is_refused_with_its_name_and_what_is_wrong(tmp_path, change, said):
    message = damaged(write_passport(tmp_path, WHOLE), change)
    assert said in message
    assert "orthant-3.json" in message


@pytest.mark.parametrize("content", [b"{", b"\xff\xfe", b"[]", b""])
def test_a_file_that_is_no_json_object_is_refused(tmp_path, content):
    path = tmp_path / "x.json"
    path.write_bytes(content)
    with pytest.raises(RunFolderError, match=r"x\.json is damaged"):
        read_passport(path)


def test_a_missing_file_is_told(tmp_path):
    with pytest.raises(RunFolderError, match="is missing"):
        read_passport(tmp_path / "nobody.json")


def test_one_is_told_as_one_and_many_as_many(tmp_path):
    search = FallSearch("any start", 10.0, 100, 1, 2, -0.1, confirmed=1, unconfirmed=0)
    one = replace(WHOLE, falls=(search,))
    console = Console(file=io.StringIO(), width=100)
    print_passport(one, CompassWalker(), console)
    print_passport(replace(WHOLE, falls=(replace(search, confirmed=2),)), CompassWalker(), console)
    printed = console.file.getvalue()
    assert "1 counterexample, walked" in printed
    assert "2 counterexamples, walked" in printed
    write_summary([one], tmp_path)
    told = (tmp_path / "summary.md").read_text(encoding="utf-8")
    assert "Of 1 walker, with the free clock 0 repeat themselves and 0 wander" in told
    assert "with the touchdown clock 1 repeats itself" in told
    assert "Of the 1 that is up, 1 completes a described cycle" in told
    assert "Of 1 walker searched for falls, 0 have no counterexample" in told
    assert "before random search 1 time, after it 0 times" in told
    write_summary([one, one], tmp_path)
    told = (tmp_path / "summary.md").read_text(encoding="utf-8")
    assert "Of 2 walkers, with the free clock 0 repeat themselves" in told
    assert "Of the 2 that are up, 2 complete a described cycle" in told
    row, _ = csv.DictReader((tmp_path / "walkers.csv").read_text(encoding="utf-8").splitlines())
    assert (row["walker"], row["up"]) == (one.walker.name, "True")
    assert float(row["multiplier_of_a_step"]) == pytest.approx(one.stability.largest, rel=1e-5)
