"""Lanes in processes of their own, as many at once as there are cores: for trainers written in Python."""

from __future__ import annotations

import multiprocessing
import os
import signal
import sys
import threading
import time
import traceback
from collections import deque
from collections.abc import Callable, Iterator, Mapping, Sequence, Set
from contextlib import contextmanager, suppress
from multiprocessing import resource_tracker
from multiprocessing.connection import Connection, wait
from multiprocessing.process import BaseProcess
from typing import NamedTuple, Protocol, runtime_checkable

from coachable.experiments.log import Columns
from coachable.foundation.errors import CoachableError, PlanError, RunFolderError


class Progress(NamedTuple):
    """How far a lane is."""

    steps: int
    """Training steps so far."""
    latest: Columns
    """Its latest evaluation, by column."""
    done: bool
    """Whether it is trained, tested and saved."""


Report = Callable[[Progress], None]
"""Raises `KeyboardInterrupt` when the lane has to stop; the caller then saves and lets that pass."""

SECONDS_BETWEEN_REPORTS = 0.5
SECONDS_TO_STOP = 1.5
"""How long a lane that has to stop may take until it saves; one that is stuck in a step is ended then."""
SAVING = "saving"
"""What a process sends when it was asked to stop and saves."""


@runtime_checkable
class LaneWork(Protocol):
    """What a process is given: a value that can be sent to it."""

    @property
    def name(self) -> str:
        """For messages."""
        ...

    def finished(self) -> Progress | None:
        """The last progress, if there is nothing left to do."""
        ...

    def run(self, report: Report) -> None:
        """Train from the lane's checkpoint, or from the start, until all is saved."""
        ...


def run_lanes(
    works: Sequence[LaneWork],
    num_workers: int,
    receive: Callable[[int, Progress], None],
    watch: Callable[[], None],
    every: float = 0.25,
) -> None:
    """Run every work in a process of its own, `num_workers` at once, and `receive` their progress.

    `receive` is called with the index of a work and its progress, `watch` at least every `every` seconds. An
    exception in a work, in `receive` or in `watch` (Ctrl-C arrives there) stops all processes, and is raised.
    Processes save what they have; one that does not come to that within `SECONDS_TO_STOP` is ended, and
    another Ctrl-C ends all of them at once.

    **Raises:** what a work raised that is a user's mistake, or an `OSError`; `RunFolderError` for a process
    that was killed; `RuntimeError` with the other process's traceback for anything else.
    """
    waiting = deque(enumerate(works))
    running: dict[Connection, tuple[int, BaseProcess]] = {}
    ready: set[Connection] = set()
    context = multiprocessing.get_context("spawn")
    try:
        while waiting or running:
            while waiting and len(running) < num_workers:
                index, work = waiting.popleft()
                if (last := work.finished()) is not None:
                    receive(index, last)
                    continue
                ours, theirs = context.Pipe()
                process = context.Process(target=_work, args=(work, theirs), daemon=True)
                with _ctrl_c_deferred():  # until the process can be stopped
                    process.start()
                    running[ours] = (index, process)
                theirs.close()
            watch()
            for channel in wait([*running], every):
                assert isinstance(channel, Connection)
                index, process = running[channel]
                try:
                    received = channel.recv()
                except (EOFError, OSError):
                    process.join()
                    del running[channel]
                    _require_success(works[index], process.exitcode)
                else:
                    if isinstance(received, BaseException):
                        raise received
                    if received is None:
                        ready.add(channel)
                    elif received != SAVING:  # stopped from outside; its end comes next
                        receive(index, received)
    finally:
        _stop({channel: process for channel, (_, process) in running.items()}, ready)


def _stop(running: Mapping[Connection, BaseProcess], ready: Set[Connection]) -> None:
    """Let processes save, and end those that do not come to it in time; none is left."""
    try:
        for channel, process in running.items():
            if channel in ready:
                with suppress(OSError):  # it may have ended by itself
                    channel.send(None)
            else:
                process.kill()  # it has nothing to save
        deadline, alive, saving = time.monotonic() + SECONDS_TO_STOP, {*running}, set[Connection]()
        while alive and (time.monotonic() < deadline or alive & saving):
            for channel in wait([*alive], 0.1):
                assert isinstance(channel, Connection)
                try:
                    if channel.recv() == SAVING:
                        saving.add(channel)
                except (EOFError, OSError):
                    alive.remove(channel)
    finally:
        for process in running.values():
            process.kill()
            process.join()


@contextmanager
def _ctrl_c_deferred() -> Iterator[None]:
    """Ctrl-C arrives after the block; processes that are started in it do not get it, where that can be."""
    if threading.current_thread() is not threading.main_thread():  # Python handles signals in no other
        with _ctrl_c_blocked():
            yield
        return
    arrived = []
    handler = signal.signal(signal.SIGINT, lambda *arguments: arrived.append(arguments))
    try:
        with _ctrl_c_blocked():
            yield
    finally:
        signal.signal(signal.SIGINT, handler)
    if arrived and callable(handler):
        handler(*arrived[0])


@contextmanager
def _ctrl_c_blocked() -> Iterator[None]:
    """Processes that are started in the block do not get Ctrl-C, for they inherit what this thread blocks.

    Other threads of this process still get it. Windows has no such masks: there, processes that are starting
    end with Ctrl-C, which then reaches this one too.
    """
    if not hasattr(signal, "pthread_sigmask"):
        yield
        return
    resource_tracker.ensure_running()  # it would unblock the signal when a process is what starts it
    before = signal.pthread_sigmask(signal.SIG_BLOCK, {signal.SIGINT})
    try:
        yield
    finally:
        signal.pthread_sigmask(signal.SIG_SETMASK, before)


def _require_success(work: LaneWork, exitcode: int | None) -> None:
    if exitcode:
        raise RunFolderError(
            f"the process that trained {work.name} was ended from outside (exit code {exitcode}), perhaps "
            "for lack of memory; the same command goes on from its last checkpoint"
        )


def _work(work: LaneWork, channel: Connection) -> None:
    """What a process does. If its parent asks for it or has ended, it stops when it next reports.

    If that takes too long, as in an episode that never ends, it ends as it is, with its last checkpoint.
    """
    stop_requested, stops = threading.Event(), threading.Event()
    # Ctrl-C in a terminal reaches every process of it; the parent alone decides.
    signal.signal(signal.SIGINT, signal.SIG_IGN)
    signal.signal(signal.SIGTERM, lambda *_: stop_requested.set())
    # Lanes keep the cores busy, so each compiled program needs but one thread.
    os.environ["NPROC"] = "1"
    reported_at = 0.0
    channel.send(None)  # from now on it stops in good order

    def listen() -> None:
        while not (stop_requested.is_set() or _is_readable(channel)):
            time.sleep(0.1)
        if not stops.wait(SECONDS_TO_STOP):
            os._exit(1)

    def report(progress: Progress) -> None:
        nonlocal reported_at
        if stop_requested.is_set() or _is_readable(channel):
            stops.set()
            with suppress(OSError):  # the parent may have ended
                channel.send(SAVING)
            raise KeyboardInterrupt
        if progress.done or time.monotonic() > reported_at + SECONDS_BETWEEN_REPORTS:
            reported_at = time.monotonic()
            channel.send(progress)

    threading.Thread(target=listen, daemon=True).start()
    try:
        work.run(report)
    except KeyboardInterrupt:
        sys.exit(1)  # a parent that asked for it no longer looks; to any other it has not finished
    except PlanError as error:
        channel.send(PlanError(f"{work.name}: {error}"))
    except (CoachableError, OSError) as error:
        channel.send(error)
    except Exception:
        channel.send(RuntimeError(f"{work.name} failed in its process:\n{traceback.format_exc()}"))


def _is_readable(channel: Connection) -> bool:
    """Whether the parent wrote something, which can only be that this process is to stop, or has ended."""
    try:
        return channel.poll()
    except OSError:
        return True
