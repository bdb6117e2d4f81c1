"""What a person sees while a study runs: a bar and a line per setup, or a line at times."""

from __future__ import annotations

import contextlib
import time
from collections.abc import Callable, Iterator
from dataclasses import dataclass

from rich.console import Console, Group
from rich.live import Live
from rich.progress import BarColumn, Progress, ProgressColumn, Task, TextColumn, TimeElapsedColumn
from rich.table import Table
from rich.text import Text

SECONDS_BETWEEN_LINES = 30.0
_MOST_MARKS = 40


@dataclass(frozen=True)
class SetupStatus:
    """How the lanes of one setup did in their latest evaluation."""

    name: str
    num_lanes: int
    num_evaluated: int
    num_up: int
    """Lanes whose walker did not fall."""
    result: str
    """What they reached in the mean, falls included, with its unit; empty before the first evaluation."""

    def __str__(self) -> str:
        if not self.num_evaluated:
            return f"{self.name}: not evaluated yet"
        return f"{self.name}: {self.result}, {self.num_up}/{self.num_evaluated} up"


@dataclass(frozen=True)
class Status:
    """Where a study stands."""

    doing: str
    """What is under way: `compiling`, `training`, …"""
    steps: int
    """Training steps done, all lanes together, those before a resume included."""
    total_steps: int
    lanes_measured: int
    """Lanes whose final walker has been put to the test."""
    setups: tuple[SetupStatus, ...]


Report = Callable[[Status], None]


@contextlib.contextmanager
def progress_display(title: str, console: Console | None = None) -> Iterator[Report]:
    """A function that shows each status it is given: live in a terminal, else as a line every half minute."""
    console = console or Console(stderr=True)
    if not console.is_terminal:
        yield _Lines(title, console)
        return
    display = _Display(title)
    with Live(get_renderable=display.render, console=console, refresh_per_second=4, transient=False):
        yield display


class _Lines:
    """One line at a change of activity, and one every half minute in between."""

    def __init__(self, title: str, console: Console):
        self._title, self._console = title, console
        self._speed = _Speed()
        self._doing, self._next = "", 0.0

    def __call__(self, status: Status) -> None:
        self._speed.see(status)
        now = time.monotonic()
        finished = status.steps >= status.total_steps
        if status.doing == self._doing and (now < self._next or finished):
            return
        self._doing, self._next = status.doing, now + SECONDS_BETWEEN_LINES
        left = self._speed.seconds_left(status.total_steps)
        parts = [
            f"{self._title}: {status.doing}",
            f"{status.steps:,} of {status.total_steps:,} steps",
            *([f"{self._speed.value:,.0f} steps/s"] if self._speed.value else []),
            *([f"{_duration(left)} left"] if left else []),
            *(str(setup) for setup in status.setups if setup.num_evaluated),
        ]
        self._console.print(" · ".join(parts), soft_wrap=True, highlight=False, markup=False)


class _Display:
    """The bar and the setups' lines, drawn anew whenever the terminal is refreshed."""

    def __init__(self, title: str):
        self._speed = _Speed()
        self._progress = Progress(
            TextColumn("[bold]{task.description}"),
            BarColumn(bar_width=None),
            TextColumn("{task.percentage:>3.0f} %"),
            _SpeedColumn(self._speed),
            TimeElapsedColumn(),
            expand=True,
        )
        self._title = title
        self._task = self._progress.add_task(title, total=None)
        self._setups: tuple[SetupStatus, ...] = ()

    def __call__(self, status: Status) -> None:
        self._speed.see(status)
        self._setups = status.setups
        measured = f" {status.lanes_measured} lanes" if status.lanes_measured else ""
        self._progress.update(
            self._task,
            description=f"{self._title}: {status.doing}{measured}",
            total=status.total_steps,
            completed=status.steps,
        )

    def render(self) -> Group:
        lines = Table.grid(padding=(0, 2))
        for setup in self._setups:
            evaluated, up = setup.num_evaluated, setup.num_up
            marks = "▪" * up + "▫" * (evaluated - up) if evaluated <= _MOST_MARKS else ""
            cells = (setup.result, f"{up}/{evaluated} up", marks) if evaluated else ("–", "", "")
            lines.add_row(f"  {setup.name}", *cells)
        return Group(self._progress, lines)


class _Speed:
    """Training steps a second since the first status in which there were more than at the start."""

    def __init__(self) -> None:
        self._first: tuple[float, int] | None = None
        self._last: tuple[float, int] | None = None

    def see(self, status: Status) -> None:
        if status.doing in ("compiling", "starting"):
            return  # what was done before a resume is not known yet, and would count as done since
        steps = status.steps
        now = (time.monotonic(), steps)
        if self._first is None or steps == self._first[1]:
            self._first = now
        if self._last is None or steps != self._last[1]:
            self._last = now

    @property
    def value(self) -> float:
        """Steps per second; 0 while unknown."""
        if self._first is None or self._last is None or self._last[0] <= self._first[0]:
            return 0.0
        return (self._last[1] - self._first[1]) / (self._last[0] - self._first[0])

    def seconds_left(self, total: int) -> float:
        return (total - self._last[1]) / self.value if self._last and self.value else 0.0


class _SpeedColumn(ProgressColumn):
    """Steps a second, and how long the rest takes at that speed."""

    def __init__(self, speed: _Speed):
        super().__init__()
        self._speed = speed

    def render(self, task: Task) -> Text:
        if not self._speed.value or task.total is None:
            return Text("")
        left = self._speed.seconds_left(int(task.total))
        return Text(f"{self._speed.value:,.0f} steps/s · {_duration(left)} left", style="cyan")


def _duration(seconds: float) -> str:
    minutes, seconds = divmod(round(seconds), 60)
    hours, minutes = divmod(minutes, 60)
    return f"{hours} h {minutes:02d} min" if hours else f"{minutes} min {seconds:02d} s"
