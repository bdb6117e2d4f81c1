"""Ctrl-C and SIGTERM: a program leaves where it is, but for the blocks that have something to put in order.

An exception does not stop a program wherever it is. What imports a module, compiles, frees an object or is
called from C may swallow it or make another one of it, a solver has a handler of its own, and code in C that
takes long, such as an environment that hangs, never returns to raise it. So outside of those blocks there is
no exception, but an end: files are written beside and renamed, so that none is left half-written.
"""

from __future__ import annotations

import contextlib
import os
import signal
import sys
import threading
import time
from types import FrameType
from typing import NoReturn, Self

SECONDS_APART = 0.2
"""Signals that are closer are one: what runs a program may send it what the terminal has sent already."""
_SIGNALS = (signal.SIGINT, signal.SIGTERM)


def leave_on_signals(last_words: str) -> Leave:
    """Let Ctrl-C and SIGTERM end this program, whatever its threads do; to be called first of all.

    Python calls a handler only once the main thread is back from C, so a thread that hears of signals through
    a pipe does the same.
    """
    leave = Leave(last_words)
    for number in _SIGNALS:
        if signal.getsignal(number) != signal.SIG_IGN:  # as a shell has it for a job in the background
            signal.signal(number, leave)
    heard, noted = os.pipe()
    os.set_blocking(noted, False)
    signal.set_wakeup_fd(noted)
    os.register_at_fork(after_in_child=_as_any_program)
    threading.Thread(target=leave.listen, args=(heard,), daemon=True).start()
    return leave


class Leave:
    """A handler of signals that ends the program at once: one line, no child left, exit code 128 + signal."""

    def __init__(self, last_words: str):
        self._last_words = last_words
        self._asked: int | None = None
        self._leaving = False
        self._lock = threading.RLock()

    def __call__(self, number: int | None = None, frame: FrameType | None = None) -> NoReturn:
        """Leave by this signal, or else by the one that raised `KeyboardInterrupt`."""
        self._lock.acquire()  # for ever: another thread that leaves, too, waits here for the end
        if not self._leaving:
            self._leaving = True
            # On a terminal it comes after ^C, and a display may have hidden the cursor.
            begin = "\n\x1b[?25h" if os.isatty(2) else ""
            with contextlib.suppress(OSError):
                os.write(2, f"{begin}{self._last_words}\n".encode(errors="replace"))
        # While it is still being imported it lacks the function, and there are no children.
        for child in getattr(sys.modules.get("multiprocessing"), "active_children", tuple)():
            child.kill()
        os._exit(128 + (number or self._asked or signal.SIGINT))

    def interrupt(self, number: int, frame: FrameType | None) -> None:
        """Raise `KeyboardInterrupt` instead, once: the handler in an `Interruptible` block."""
        if self._asked is None:
            self._asked = number
            raise KeyboardInterrupt

    def listen(self, heard: int) -> None:
        """Leave for a signal that comes in through a pipe, in an `Interruptible` block for the second one."""
        asked_at = None
        while True:
            number = os.read(heard, 1)[0]
            if number not in _SIGNALS:
                continue  # of an environment's own handler
            asked_at = asked_at or time.monotonic()
            if signal.getsignal(number) == self or time.monotonic() > asked_at + SECONDS_APART:
                self(number)


class Interruptible:
    """A block in which the first signal raises `KeyboardInterrupt`, as it does in other Python programs.

    It is for what has to be saved or removed before the program ends; another signal ends it all the same.
    Where no program leaves on signals, as in a notebook, and in threads, which get none, it changes nothing.
    """

    def __enter__(self) -> Self:
        self._leaves: dict[int, Leave] = {}
        if threading.current_thread() is threading.main_thread():
            for number in _SIGNALS:
                if isinstance(leave := signal.getsignal(number), Leave):
                    self._leaves[number] = leave
                    signal.signal(number, leave.interrupt)
        return self

    def __exit__(self, *error: object) -> None:
        for number, leave in self._leaves.items():
            signal.signal(number, leave)


def _as_any_program() -> None:
    """A child that an environment forks is no program of ours, and shares the pipe."""
    signal.set_wakeup_fd(-1)
    signal.signal(signal.SIGINT, signal.default_int_handler)
    signal.signal(signal.SIGTERM, signal.SIG_DFL)
