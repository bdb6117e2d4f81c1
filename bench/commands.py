"""Run commands of `coachable` one after another in one process, which saves the seconds that imports take.

What command N prints goes into `printed-N-COMMAND.txt` (`.json` with `--json`) of the working directory, and
its exit status into `exit-status.txt`. A command that fails, other than with the exit status 1 of a negative
verdict, ends the process.
"""

from __future__ import annotations

import io
import sys
from collections.abc import Sequence
from contextlib import redirect_stdout
from pathlib import Path


def run(commands: Sequence[str]) -> None:
    """Run commands, each split at spaces."""
    from coachable.cli import main

    statuses = []
    for number, command in enumerate(commands, start=1):
        words, printed, status = command.split(), io.StringIO(), 0
        with redirect_stdout(printed):
            try:
                main(words)
            except SystemExit as end:
                status = end.code
        if status not in (0, None, 1):
            raise SystemExit(f"`coachable {command}` ended with exit status {status}")
        # A run of the paper's study has another command in another checkout.
        name = "train" if words[0] == "study" else words[0]
        suffix = "json" if "--json" in words else "txt"
        Path(f"printed-{number:02d}-{name}.{suffix}").write_text(printed.getvalue(), encoding="utf-8")
        statuses.append(f"{number:02d} {name}: {status or 0}\n")
    Path("exit-status.txt").write_text("".join(statuses), encoding="utf-8")


if __name__ == "__main__":
    run(sys.argv[1:])
