"""How work on many walkers goes on: a bar with the time left in a terminal, else a line now and then."""

from __future__ import annotations

import contextlib
import threading
import time
from collections.abc import Iterator

from rich.console import Console
from rich.progress import (
    BarColumn,
    MofNCompleteColumn,
    Progress,
    TextColumn,
    TimeElapsedColumn,
    TimeRemainingColumn,
)

from coachable.verification.passport.verify import ProgressCallback

SECONDS_BETWEEN_LINES = 30.0


@contextlib.contextmanager
def walkers_progress(
    doing: str, num_walkers: int, console: Console | None = None
) -> Iterator[ProgressCallback]:
    """A function to call with how much of a walker is done, which may be called from any thread."""
    console = console or Console(stderr=True)
    if not num_walkers:
        yield lambda name, share: None
    elif console.is_terminal:
        with _bar(doing, num_walkers, console) as advance:
            yield advance
    else:
        yield _Lines(doing, num_walkers, console)


@contextlib.contextmanager
def _bar(doing: str, num_walkers: int, console: Console) -> Iterator[ProgressCallback]:
    columns = (
        TextColumn(f"[bold]{doing}"),
        BarColumn(bar_width=None),
        MofNCompleteColumn(),
        TextColumn("{task.description}"),
        TimeElapsedColumn(),
        TextColumn("left"),
        TimeRemainingColumn(),
    )
    with Progress(*columns, console=console, expand=True) as progress:
        task = progress.add_task("beginning", total=num_walkers)
        yield lambda name, share: progress.update(task, advance=share, description=name)


class _Lines:
    """A line every half minute."""

    def __init__(self, doing: str, num_walkers: int, console: Console):
        self._doing = doing
        self._total, self._console = num_walkers, console
        self._done, self._began = 0.0, time.monotonic()
        self._next = self._began + SECONDS_BETWEEN_LINES
        self._lock = threading.Lock()

    def __call__(self, name: str, share: float) -> None:
        with self._lock:
            self._done += share
            now = time.monotonic()
            if now < self._next:
                return
            self._next = now + SECONDS_BETWEEN_LINES
            left = (now - self._began) * (self._total / self._done - 1)
            self._console.print(
                f"{self._doing}: {self._done:.1f} of {self._total} walkers · about {left:.0f} s left · "
                f"{name}",
                soft_wrap=True,
                highlight=False,
                markup=False,
            )
