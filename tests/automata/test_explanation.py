import csv
import gzip
import json
import re
import subprocess
import sys

import numpy as np
import pyarrow as pa
import pyarrow.parquet as pq
import pytest

from coachable import cli
from coachable.automata.explanation import as_json, as_text, explain
from coachable.automata.monitor import Monitor
from coachable.automata.trace import Trace
from coachable.automata.trace_file import read_trace, write_trace
from coachable.behaviours import load_behaviour
from coachable.behaviours.predicates import Signal
from coachable.behaviours.text import parse
from coachable.envs.baselines import baseline
from coachable.foundation.errors import TraceError

WALKING = load_behaviour("compass-walking")
NAMES = WALKING.signal_names


@pytest.fixture(scope="module")
def walk():
    trajectory = baseline("virtual-gravity").trajectory
    return {"t": trajectory.time} | {name: getattr(trajectory, name) for name in NAMES}


def write(path, columns):
    """Write columns as CSV, with every digit."""
    with gzip.open(path, "wt", newline="") if path.suffix == ".gz" else path.open("w", newline="") as file:
        writer = csv.writer(file)
        writer.writerow(columns)
        writer.writerows(zip(*(map(repr, map(float, column)) for column in columns.values()), strict=True))
    return path


def run(capsys, *arguments):
    with pytest.raises(SystemExit) as left:
        cli.main(["explain", *map(str, arguments)])
    out, err = capsys.readouterr()
    return left.value.code, out, err


def test_a_limit_of_violations_that_is_none_is_refused(tmp_path):
    path = tmp_path / "some.csv"
    path.write_text(HEADER + ROW)
    with pytest.raises(TraceError, match="limit must be at least 0, got -1"):
        explain(WALKING, path, limit=-1)


def test_a_file_is_explained_as_the_monitor_explains_its_rows(walk, tmp_path, monkeypatch):
    monkeypatch.setattr("coachable.automata.trace_file._BYTES_OF_CSV", 4096)
    path = write(tmp_path / "walk.csv", walk)
    monitor = Monitor(WALKING)
    columns = {name: walk[name] for name in NAMES}
    violations = monitor.feed_rows(walk["t"], columns)[1]
    chunks = []
    explanation = explain(WALKING, path, limit=None, progress=chunks.append)
    assert explanation.shown == violations
    assert explanation.report == monitor.report()
    assert len(chunks) > 1


def test_virtual_gravity_leaves_the_cycle_at_every_touchdown(walk, tmp_path, capsys):
    path = write(tmp_path / "walk.csv", walk)
    code, out, _ = run(capsys, "compass-walking", path, "--limit", 2)
    assert code == 1
    assert "1,001 samples, t = 0 s to 10 s" in out
    assert "97.4 % of the samples" in out
    assert "(starts in no phase: 1, leaves all phases: 13)" in out
    assert "t = 0.36 s: O4 → outside leaves all phases." in out
    assert "O1: swing leg swings forward (dtheta_2 fell short of its bound 0 by 0.314 rad/s)." in out
    assert "… and 12 more; --all shows them." in out
    code, out, _ = run(capsys, "compass-walking", path, "--all")
    assert out.count("leaves all phases.") == 13


def test_a_trace_that_follows_exits_with_zero(walk, tmp_path, capsys):
    rows = slice(5, 30)
    path = write(tmp_path / "part.csv", {name: column[rows] for name, column in walk.items()})
    cli.main(["explain", "compass-walking", str(path)])
    out = capsys.readouterr().out
    assert out.endswith("It follows the behaviour.\n")


def test_json_says_the_same(walk, tmp_path, capsys):
    path = write(tmp_path / "walk.csv", walk)
    code, out, _ = run(capsys, "compass-walking", path, "--json", "--limit", 3)
    told = json.loads(out)
    assert code == 1
    assert told["follows"] is False
    assert told["samples"] == 1001
    assert told["violations"] == {"starts in no phase": 1, "leaves all phases": 13}
    assert [violation["t"] for violation in told["shown"]] == [0.0, 0.36, 1.12]
    assert told["first_violation"] == told["shown"][0]
    assert [phase["phase"] for phase in told["phases"]] == ["O1", "O2", "O3", "O4"]
    assert told["phases"][0]["stays"] == 13


def test_the_phase_at_each_moment_can_be_written_down(walk, tmp_path):
    phases = tmp_path / "phases.csv"
    explain(WALKING, write(tmp_path / "walk.csv", walk), phases=phases)
    with phases.open() as file:
        rows = list(csv.DictReader(file))
    assert [float(row["t [s]"]) for row in rows] == walk["t"].tolist()
    expected = [WALKING.phase_at({name: walk[name][row] for name in NAMES}) or "" for row in range(len(rows))]
    assert [row["phase"] for row in rows] == expected


def test_phases_are_never_written_over_the_trace(walk, tmp_path, capsys):
    path = write(tmp_path / "walk.csv", walk)
    before = path.read_bytes()
    (tmp_path / "link.csv").symlink_to(path)
    for phases in (path, tmp_path / "link.csv"):
        code, _, err = run(capsys, "compass-walking", path, "-o", phases)
        assert (code, "give another file" in err) == (2, True)
        assert path.read_bytes() == before


def test_a_place_that_cannot_be_written_to_is_named(walk, tmp_path, capsys):
    path, nowhere = write(tmp_path / "walk.csv", walk), tmp_path / "nowhere"
    code, _, err = run(capsys, "compass-walking", path, "-o", nowhere / "phases.csv")
    assert (code, f"{nowhere / 'phases.csv'}: No such file" in err) == (2, True)
    for name in ("walk.csv", "walk.csv.gz", "walk.parquet"):
        with pytest.raises(TraceError, match=f"{name}: cannot be written"):
            write_trace(nowhere / name, Trace(walk["t"], WALKING.signals, walk))


@pytest.mark.parametrize(("letter", "name"), [(";", "semicolons"), ("\t", "tabs")])
def test_columns_that_are_separated_otherwise_are_told(letter, name, tmp_path):
    path = tmp_path / "other.csv"
    path.write_text((HEADER + ROW).replace(",", letter))
    with pytest.raises(TraceError, match=f"{name} separate its columns"):
        explain(WALKING, path)


def test_one_sample_is_one(tmp_path):
    path = tmp_path / "one.csv"
    path.write_text(HEADER + ROW)
    assert ": 1 sample, t = 0 s to 0 s" in as_text(explain(WALKING, path))


def test_every_kind_of_file_holds_the_same(walk, tmp_path):
    named = {"time [s]": walk["t"], "theta_1 [rad]": walk["theta_1"], "dtheta_1 [ rad/s ]": walk["dtheta_1"]}
    named |= {"other": walk["t"], "theta_2": walk["theta_2"], "dtheta_2": walk["dtheta_2"]}
    table = pa.table({name: np.asarray(column) for name, column in named.items()})
    pq.write_table(table, tmp_path / "walk.parquet")
    plain = explain(WALKING, write(tmp_path / "walk.csv", walk))
    for path in (
        write(tmp_path / "named.csv", named),
        write(tmp_path / "named.csv.gz", named),
        tmp_path / "walk.parquet",
    ):
        explanation = explain(WALKING, path)
        assert (explanation.report, explanation.shown) == (plain.report, plain.shown)


def test_dt_takes_the_place_of_a_time_column(walk, tmp_path):
    path = write(tmp_path / "walk.csv", {name: walk[name] for name in NAMES})
    report = explain(WALKING, path, dt=0.5).report
    assert (report.start, report.end) == (0.0, 500.0)
    with pytest.raises(TraceError, match="there is no column t or time; give the time between two rows"):
        explain(WALKING, path)


@pytest.mark.parametrize(("signal", "time"), [("t", "time"), ("time", "t")])
def test_a_signal_that_is_called_like_the_time_is_not_taken_for_it(signal, time, tmp_path):
    path = tmp_path / "named.csv"
    path.write_text(f"{signal},{time}\n5,0\n4,1\n")
    (trace,) = read_trace(path, (Signal(signal, "m"),))
    assert trace.time.tolist() == [0, 1]
    assert trace.values[signal].tolist() == [5, 4]


def test_an_empty_cell_is_outside_and_named(walk, tmp_path):
    path = tmp_path / "gap.csv"
    path.write_text("t,theta_1,theta_2,dtheta_1,dtheta_2\n0,0.1,-0.1,-1,1\n1,0.1,,-1,1\n")
    (violation,) = explain(WALKING, path).shown
    assert violation.sentence == "t = 1 s: O1 → outside leaves all phases. theta_2 is NaN."


HEADER = "t,theta_1,theta_2,dtheta_1,dtheta_2\n"
ROW = "0,0.1,-0.1,-1,1\n"


@pytest.mark.parametrize(
    ("text", "words"),
    [
        ("", "the file is empty"),
        (HEADER, "it has a header but no rows"),
        (HEADER.replace("theta_2", "tetha_2", 1) + ROW, r"no column theta_2; did you mean 'tetha_2'\?"),
        (HEADER.replace(",dtheta_1", ",dtheta_1 [deg/s]") + ROW, "dtheta_1 is in deg/s, but .* in rad/s"),
        (HEADER.replace("t,", "t [N],", 1) + ROW, "column t is in N, but the time is in s"),
        (HEADER.replace("dtheta_2", "hip") + ROW, "no column dtheta_2; known: 'hip'"),
        (HEADER.replace("\n", ",theta_1\n") + "0,1,1,1,1,1\n", "more than one column theta_1"),
        (HEADER.replace("\n", ",theta_1 [rad]\n") + "0,1,1,1,1,1\n", "more than one column theta_1"),
        (HEADER + ROW + "1,high,0,0,0\n", "invalid value 'high'"),
        (HEADER + ROW + f"1,{'9' * 5000},0,0,0\n", "sample 2: theta_1 is infinite, or larger than"),
        (HEADER + ROW + "1,0,-inf,0,0\n", "sample 2: theta_2 is infinite"),
        (HEADER + ROW + "1,0\n", "Expected 5 columns, got 2"),
        (HEADER + ROW + ROW, "sample 2: the time goes from 0 s to 0 s"),
        (HEADER + ROW.replace("0,", ",", 1), "sample 1: its time is not a number"),
    ],
)
def test_a_file_that_cannot_be_read_is_told_apart_and_exits_with_two(text, words, tmp_path, capsys):
    path = tmp_path / "bad.csv"
    path.write_text(text)
    with pytest.raises(TraceError, match=words) as told:
        explain(WALKING, path)
    assert str(told.value).startswith(f"{path}: ")
    code, out, err = run(capsys, "compass-walking", path)
    assert (code, out) == (2, "")
    assert "Traceback" not in err


@pytest.mark.parametrize("name", ["noise.csv", "noise.csv.gz", "noise.parquet"])
def test_noise_is_no_trace(name, tmp_path):
    path = tmp_path / name
    path.write_bytes(np.random.default_rng(0).bytes(5000))
    with pytest.raises(TraceError, match=name):
        explain(WALKING, path)


def test_a_missing_file_and_a_senseless_dt_are_refused(tmp_path):
    with pytest.raises(TraceError, match="there is no such file"):
        list(read_trace(tmp_path / "none.csv", WALKING.signals))
    path = tmp_path / "some.csv"
    path.write_text(HEADER + ROW)
    for dt in (0.0, -1.0, float("nan"), float("inf")):
        with pytest.raises(TraceError, match="greater than zero"):
            list(read_trace(path, WALKING.signals, dt))


def test_an_unknown_behaviour_exits_with_two(tmp_path, capsys):
    code, _, err = run(capsys, "compass-wandering", tmp_path / "none.csv")
    assert code == 2
    assert "did you mean 'compass-walking'?" in err


def test_help_has_examples(capsys):
    code, out, _ = run(capsys, "--help")
    assert code == 0
    assert "coachable explain compass-walking log.csv" in out


def test_as_text_and_as_json_agree_on_the_numbers(walk, tmp_path):
    explanation = explain(WALKING, write(tmp_path / "walk.csv", walk))
    text, told = as_text(explanation), as_json(explanation)
    for phase in told["phases"]:
        assert f"{phase['mean']:.3f}" in text
        assert f"{100 * phase['share']:.1f} %" in text


def test_explaining_loads_no_jax():
    program = "import sys, coachable.automata.explanation\nassert 'jax' not in sys.modules"
    subprocess.run([sys.executable, "-c", program], check=True)


def test_columns_are_read_by_the_meaning_of_their_units(tmp_path):
    path = tmp_path / "units.csv"
    path.write_text("t [ms],acc [m/s**2],torque [N mm],load [N]\n0,1,500,3\n250,2,-750,4\n")
    signals = (Signal("acc", "m/s^2"), Signal("torque", "N*m"), Signal("load", "N"))
    (trace,) = read_trace(path, signals)
    assert trace.time.tolist() == [0.0, 0.25]
    assert [trace.values[signal.name].tolist() for signal in signals] == [[1, 2], [0.5, -0.75], [3, 4]]
    assert trace.converted == ("torque is converted from column 'torque [N mm]': × 1/1000",)
    assert trace.clock == "milliseconds, converted to s"
    path.write_text("t,acc [deg/s^2],torque,load\n0,1,1,1\n")
    with pytest.raises(TraceError, match=r"acc is in deg/s\^2, but .* is in m/s\^2"):
        list(read_trace(path, signals))


FOOT = parse(
    """
behaviour "foot"

signals
  load  [N]

phases
  stance  for at most 2 s:  load > 20 [N]
  swing   for at most 1 s:  load <= 20 [N]

cycle
  stance -> swing -> stance
"""
)
LOADS = [500.0] * 5 + [0.0] * 3 + [500.0] * 4 + [0.0] * 3 + [500.0]


def test_a_gap_is_reported_and_judges_nothing(tmp_path):
    times = [*(0.1 * np.arange(8)), *(9.0 + 0.1 * np.arange(8))]
    explanation = explain(FOOT, write(tmp_path / "gap.csv", {"t": times, "load": LOADS}))
    report = explanation.report
    assert report.follows
    assert (report.gaps.count, report.gaps.total) == (1, pytest.approx(8.3))
    assert report.gaps.first == pytest.approx((0.7, 9.0))
    assert report.stays["swing"].count == 1
    assert report.stays["swing"].longest == pytest.approx(0.3)
    assert report.stays["stance"].count == 0
    assert report.cycles == (1,)
    assert "8.3 s in 1 gap, t = 0.7 s to 9 s" in as_text(explanation)
    assert "where it was observed" in as_text(explanation)
    assert as_json(explanation)["gaps"]["count"] == 1


def test_a_gap_right_behind_the_first_sample_is_found_in_a_file(tmp_path):
    for count in (3, 5):
        path = write(tmp_path / "gap.csv", {"t": [0, 5, 5.1, 5.2, 5.3][:count], "load": [500] * count})
        assert explain(FOOT, path).report.gaps.first == (0, 5)


TICKS = 10_000_000 * np.arange(16)
START_NS = 1_764_460_800_000_000_000


@pytest.mark.parametrize(
    ("times", "name", "words"),
    [
        (TICKS, "t", "nanoseconds"),
        (TICKS + START_NS, "time", f"nanoseconds, converted to s from the first, {START_NS}"),
        ((TICKS + START_NS) // 1000, "time", "microseconds"),
        (TICKS // 1_000_000, "t [ms]", "milliseconds"),
        (TICKS // 1000, "t [us]", "microseconds"),
        ((TICKS + START_NS).astype("M8[ns]"), "timestamp", "dates.*2025-11-30T00:00:00"),
        ((TICKS + START_NS).astype("M8[ns]"), "stamped", "dates"),
        (TICKS.astype("m8[ns]"), "t", "durations"),
        (pa.array(TICKS + START_NS, pa.timestamp("ns", "Europe/Berlin")), "time", "dates.* UTC"),
        (TICKS / 1e9, "t", "^$"),
    ],
)
def test_every_kind_of_time_is_converted_and_said(times, name, words, tmp_path):
    path = tmp_path / "foot.parquet"
    pq.write_table(pa.table({name: times, "load": LOADS}), path)
    explanation = explain(FOOT, path)
    report = explanation.report
    duration = report.end - report.start
    assert duration == pytest.approx(0.15, abs=1e-9)
    assert report.stays["swing"].longest == pytest.approx(0.03)
    assert re.search(words, report.clock)
    assert report.clock in as_text(explanation)


def test_the_index_of_a_data_frame_is_the_time(tmp_path):
    pd = pytest.importorskip("pandas")
    for zone in (None, "Europe/Berlin"):
        index = pd.date_range("2026-01-01", periods=16, freq="10ms", tz=zone)
        pd.DataFrame({"load": LOADS}, index=index).to_parquet(tmp_path / "frame.parquet")
        report = explain(FOOT, tmp_path / "frame.parquet").report
        assert report.end == pytest.approx(0.15)
        assert ("UTC" in report.clock) == (zone is not None)


@pytest.mark.parametrize(
    ("first", "rest", "words"),
    [
        ("2026-01-01T12:00:00", "2026-01-01T12:00:00.01", "2026-01-01T12:00:00"),
        ("2026-01-01 12:00:00Z", "2026-01-01 12:00:00.01Z", "UTC"),
        ("2026-01-01T12:00:00+01:00", "2026-01-01T12:00:00.01+01:00", "2026-01-01T11:00:00.* UTC"),
        (str(START_NS), str(START_NS + 10_000_000), "nanoseconds"),
    ],
)
def test_dates_in_csv_are_times(first, rest, words, tmp_path):
    path = tmp_path / "dates.csv"
    path.write_text(f"time,load\n{first},500\n{rest},0\n")
    report = explain(FOOT, path).report
    assert (report.start, report.end) == (0, pytest.approx(0.01, abs=1e-12))
    assert re.search(words, report.clock)


def test_times_that_are_neither_numbers_nor_dates_are_refused_with_a_hint(tmp_path):
    path = tmp_path / "dates.csv"
    path.write_text("time,load\n12:00:00,500\n12:00:01,0\n")
    with pytest.raises(TraceError, match="first time is '12:00:00'; give numbers of seconds, or dates"):
        explain(FOOT, path)
    path.write_text("time,load\n,500\n2026-01-01T00:00:01,0\n")
    with pytest.raises(TraceError, match="sample 1: its time is not a number"):
        explain(FOOT, path)


@pytest.mark.parametrize("blank", ["\n", "\n\n", " \n\t\n", "\r\n", ",\n", "\ufeff\n"])
def test_blank_lines_at_the_top_are_skipped(blank, tmp_path):
    path = tmp_path / "blank.csv"
    path.write_bytes(f"{blank}t,load\n0,500\n1,0\n".encode())
    report = explain(FOOT, path).report
    assert (report.samples, report.samples_in["swing"]) == (2, 1)


def test_a_behaviour_without_signals_is_refused_in_a_sentence(tmp_path):
    none = parse('behaviour "none"\n\nphases\n  a: true\n  b: false\n\ncycle\n  a -> b -> a\n')
    path = write(tmp_path / "some.csv", {"t": [0, 1], "x": [1, 2]})
    with pytest.raises(TraceError, match="the behaviour has no signals"):
        explain(none, path)
    with pytest.raises(TraceError, match="the behaviour has no signals"):
        Monitor(none)
