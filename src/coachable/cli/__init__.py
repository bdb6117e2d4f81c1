"""The command line: parses, calls, prints."""

from __future__ import annotations

import os
import sys

TYPE_CHECKING = False  # type checkers take it for true
if TYPE_CHECKING:
    from collections.abc import Sequence

    from coachable.cli.commands import COMMANDS as COMMANDS


def main(arguments: Sequence[str] | None = None) -> None:
    """Run the command line; exits 2 after a user's mistake.

    Without `arguments` it is the program, with those that it was called with: Ctrl-C and SIGTERM end it
    wherever it is, with one line and the exit code 130 or 143.
    """
    if arguments is not None:
        from coachable.cli.commands import run

        run(list(arguments))
        return
    leave = None
    try:
        arguments = sys.argv[1:]
        # All that takes time to import comes here, and most of it after signals are handled.
        from coachable.foundation.stopping import leave_on_signals

        leave = leave_on_signals(_last_words(arguments))
        from coachable.cli.commands import run

        run(arguments)
    except KeyboardInterrupt:
        if leave is not None:
            leave()
        os.write(2, f"{_last_words(sys.argv[1:])}\n".encode(errors="replace"))
        os._exit(130)


def _last_words(arguments: list[str]) -> str:
    if arguments[:1] != ["train"] and "--all" not in arguments:
        return "Stopped."
    return f"Stopped. Nothing is lost; go on with: coachable {' '.join(map(_quoted, arguments))}"


def _quoted(word: str) -> str:
    """As `shlex.quote`, which takes long to import."""
    if word and all(letter.isalnum() or letter in "-_./:=,+" for letter in word):
        return word
    return "'" + word.replace("'", "'\"'\"'") + "'"


def __getattr__(name: str) -> object:
    if name != "COMMANDS":
        raise AttributeError(f"module {__name__!r} has no attribute {name!r}")
    from coachable.cli import commands

    return commands.COMMANDS
