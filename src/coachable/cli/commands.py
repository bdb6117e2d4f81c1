"""The commands by name, and what their mistakes end as."""

from __future__ import annotations

import contextlib
import inspect
import io
import os
import sys

import tyro

import coachable
from coachable.cli import audits, descriptions, experiments, exports, results, robots, verification, walks
from coachable.foundation.errors import CoachableError
from coachable.foundation.suggestion import suggestion

COMMANDS = {
    "train": experiments.train,
    "table": results.table,
    "compare": results.compare,
    "report": results.report,
    "watch": walks.watch,
    "record": walks.record,
    "gait": walks.gait,
    "baseline": walks.baseline,
    "verify": verification.verify,
    "check": descriptions.check,
    "format": descriptions.format,
    "draw": descriptions.draw,
    "limits": audits.limits,
    "audit": audits.audit,
    "diff": descriptions.diff,
    "explain": descriptions.explain,
    "symmetry": robots.symmetry,
    "export": exports.export,
    "cite": results.cite,
}

_STYLE = (tyro.conf.FlagCreatePairsOff,)


def run(arguments: list[str]) -> None:
    """Run the command that the arguments name; exits 2 after a user's mistake."""
    _set_up()
    try:
        _run(arguments)
        sys.stdout.flush()
    except CoachableError as error:
        print(f"coachable: {error}", file=sys.stderr)
        sys.exit(2)
    except BrokenPipeError:
        # The reader has closed the pipe, as `head` does, so there is no message to write.
        os.dup2(os.open(os.devnull, os.O_WRONLY), sys.stdout.fileno())
        sys.exit(1)
    except RecursionError:
        print("coachable: something that was given is nested too deeply to be read", file=sys.stderr)
        sys.exit(2)
    except OSError as error:
        if error.errno is None:
            raise
        where = "" if error.filename is None else f"{error.filename}: "
        print(f"coachable: {where}{error.strerror}", file=sys.stderr)
        sys.exit(2)


def _set_up() -> None:
    """Give a program whose output is closed one that goes nowhere, and let modules of the folder be found.

    As last, so that no file in the folder takes the place of an installed module. Letters that a terminal
    cannot show become question marks.
    """
    for name in ("stdout", "stderr"):
        stream = getattr(sys, name)
        if stream is None:
            setattr(sys, name, open(os.devnull, "w", encoding="utf-8"))  # noqa: SIM115
        elif isinstance(stream, io.TextIOWrapper):
            stream.reconfigure(errors="replace")
    with contextlib.suppress(OSError):
        here = os.getcwd()
        if here not in sys.path:
            sys.path.append(here)


def _run(arguments: list[str]) -> None:
    if not arguments or arguments[0] in ("-h", "--help"):
        print(_overview())
        return
    name, *rest = arguments
    if name not in COMMANDS:
        raise CoachableError(f"there is no command {name!r}; {suggestion(name, COMMANDS)}")
    command = COMMANDS[name]
    description = inspect.getdoc(command)
    tyro.cli(command, prog=f"coachable {name}", description=description, args=rest, config=_STYLE)


def _overview() -> str:
    summaries = {
        name: (inspect.getdoc(command) or "").partition("\n")[0] for name, command in COMMANDS.items()
    }
    return "\n".join(
        [
            (coachable.__doc__ or "").partition("\n")[0],
            "",
            "  coachable train demo                                        two minutes, to see it work",
            "  coachable train paper -o runs/paper                         the paper's whole study",
            "  coachable report runs/paper                                 one page: what was learned",
            "  coachable check compass-walking                             what a description says",
            "  coachable verify runs/paper --all                           does it really walk?",
            "  coachable watch runs/paper --setup orthant --seed 3 -o gait.gif",
            "",
            *(f"  {name:<10}{summary}" for name, summary in summaries.items()),
            "",
            "coachable COMMAND --help has its options, with examples.",
            "In each of them -o is the output, a file's suffix its format, and --json prints JSON.",
        ]
    )
