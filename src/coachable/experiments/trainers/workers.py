"""Worker threads that take turns on jobs, the least advanced one first."""

from __future__ import annotations

import heapq
import threading
from collections.abc import Callable, Sequence
from typing import Protocol, runtime_checkable


@runtime_checkable
class Job(Protocol):
    """Work that is done in turns, one after another; turns of different jobs share nothing."""

    @property
    def turns(self) -> int:
        """How many turns it has had."""
        ...

    @property
    def done(self) -> bool:
        """Whether it wants no more."""
        ...

    def take_turn(self) -> None:
        """Do a little more of the work."""
        ...


def take_turns(jobs: Sequence[Job], num_workers: int, watch: Callable[[], None], every: float = 0.25) -> None:
    """Work until every job is done; the calling thread meanwhile calls `watch` about every `every` seconds.

    Workers wait for each other nowhere but to pick the next job, so they cannot block one another. An
    exception in a turn or in `watch` (Ctrl-C arrives there) stops all workers after the turns under way and
    is raised.
    """
    crew = _Crew(jobs)
    threads = [threading.Thread(target=crew.work, daemon=True) for _ in range(min(num_workers, len(jobs)))]
    for thread in threads:
        thread.start()
    try:
        while not crew.wait(every):
            watch()
    finally:
        crew.stop()
        for thread in threads:
            thread.join()
    if crew.error is not None:
        raise crew.error
    watch()


class _Crew:
    def __init__(self, jobs: Sequence[Job]):
        self.error: BaseException | None = None
        self._jobs = jobs
        self._waiting = [(job.turns, index) for index, job in enumerate(jobs) if not job.done]
        heapq.heapify(self._waiting)
        self._num_open = len(self._waiting)
        self._changed = threading.Condition()
        self._stopped = False

    def work(self) -> None:
        try:
            while (index := self._next()) is not None:
                self._jobs[index].take_turn()
                self._put_back(index)
        except BaseException as error:
            with self._changed:
                self.error = self.error or error
                self._stopped = True
                self._changed.notify_all()

    def wait(self, seconds: float) -> bool:
        """Wait so long, or until all is over; return whether it is."""
        with self._changed:
            return self._changed.wait_for(lambda: self._stopped or not self._num_open, seconds)

    def stop(self) -> None:
        with self._changed:
            self._stopped = True
            self._changed.notify_all()

    def _next(self) -> int | None:
        with self._changed:
            self._changed.wait_for(lambda: self._stopped or self._waiting or not self._num_open)
            return None if self._stopped or not self._waiting else heapq.heappop(self._waiting)[1]

    def _put_back(self, index: int) -> None:
        job = self._jobs[index]
        with self._changed:
            if job.done:
                self._num_open -= 1
            else:
                heapq.heappush(self._waiting, (job.turns, index))
            self._changed.notify_all()
