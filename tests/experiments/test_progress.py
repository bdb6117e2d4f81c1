"""What is shown while a study runs, in a terminal and elsewhere."""

import io

import pytest
from rich.console import Console

from coachable.experiments import progress
from coachable.experiments.progress import SetupStatus, Status, progress_display

NOTHING = SetupStatus("sparse", 15, 0, 0, "")
WALKING = SetupStatus("orthant", 15, 15, 12, "6.43 m")


def status(doing, steps, *setups, measured=0):
    return Status(doing, steps, 1_000_000, measured, setups)


@pytest.fixture
def clock(monkeypatch):
    class Clock:
        now = 100.0

    monkeypatch.setattr(progress.time, "monotonic", lambda: Clock.now)
    return Clock


def test_elsewhere_a_line_at_every_change_and_every_half_minute(clock):
    out = io.StringIO()
    with progress_display("paper", Console(file=out, width=40)) as report:
        report(status("compiling", 0))
        for second in range(61):
            clock.now = 100.0 + second
            report(status("training", 1000 * second, NOTHING, WALKING))
        report(status("testing", 1_000_000, NOTHING, WALKING, measured=3))
        report(status("testing", 1_000_000, NOTHING, WALKING, measured=4))
    lines = out.getvalue().splitlines()
    assert [line.split(" · ")[0] for line in lines] == [
        "paper: compiling",
        "paper: training",
        "paper: training",
        "paper: training",
        "paper: testing",
    ]
    assert lines[3] == (
        "paper: training · 60,000 of 1,000,000 steps · 1,000 steps/s · 15 min 40 s left · "
        "orthant: 6.43 m, 12/15 up"
    )
    assert "\x1b" not in out.getvalue()


def test_the_speed_after_a_resume_counts_from_the_resume(clock):
    out = io.StringIO()
    with progress_display("paper", Console(file=out, width=40)) as report:
        report(status("compiling", 0))
        clock.now += 10
        report(status("training", 500_000))
        clock.now += 40
        report(status("training", 540_000))
    assert "1,000 steps/s · 7 min 40 s left" in out.getvalue().splitlines()[-1]


def test_in_a_terminal_a_bar_and_a_line_a_setup(clock):
    out = io.StringIO()
    console = Console(file=out, width=120, force_terminal=True, color_system=None, legacy_windows=False)
    with progress_display("paper", console) as report:
        report(status("training", 0, NOTHING, WALKING))
        clock.now += 10
        report(status("training", 500_000, NOTHING, WALKING))
    last = out.getvalue().rpartition("paper: training")[2]
    assert "50 %" in last
    assert "50,000 steps/s · 0 min 10 s left" in last
    assert "orthant  6.43 m  12/15 up" in last
    assert "▪" * 12 + "▫" * 3 in last
    assert "sparse   –" in last
