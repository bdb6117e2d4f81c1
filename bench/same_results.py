"""Show that two checkouts of this repository compute the same: run both, compare all results to the bit.

    python -m bench.same_results OLD NEW                         everything; about six minutes a checkout
    python -m bench.same_results OLD NEW --keep DIR              keep the results in DIR/NAME OF CHECKOUT
    python -m bench.same_results OLD NEW --only walkers export   some cases, with those that they need
    python -m bench.same_results --list                          the cases: bench/same_results.toml

OLD and NEW are folders; `git worktree add ../old COMMIT` makes one. A case is a few commands of `coachable`,
each run by this Python with the checkout's `src` first on the path, in the case's folder. All that they
print, return and write is compared: tables and tensors to the bit, JSON by key, text by line, other files by
byte. What only NEW has (a file, a column, a key) is reported, but is no failure. Exits 1 if anything else
differs that is in neither `EXPECTED` nor `EXPECTED_WORDS`. Results that are kept count until the checkout's
`src`, the case or its inputs change.
"""

from __future__ import annotations

import argparse
import hashlib
import os
import re
import shutil
import subprocess
import sys
import tempfile
import time
import tomllib
from collections.abc import Iterable, Mapping, Sequence
from concurrent.futures import Future, ThreadPoolExecutor
from dataclasses import dataclass
from fnmatch import fnmatchcase
from pathlib import Path

from bench.differences import Difference, compare_folders

EXPECTED: Mapping[str, str] = {
    "published-run/printed-02-gait.txt": "`coachable gait` measures steps, too",
    "published-run/hop-described/gaits.md": "`coachable gait` measures steps, too",
    "baselines/printed-02-baseline.json:controller": "it is called `baseline`, as in the other commands",
    "baselines/printed-0[34]-baseline.txt": "other words; printed-02 has the numbers",
}
"""CASE/FILE or CASE/FILE:COLUMN, a pattern of `fnmatch` → why it differs."""

EXPECTED_WORDS: Mapping[str, str] = {
    "published-files/results/README.md": "`coachable train` took the place of `coachable study`",
}
"""The same for text in which the words may differ, but every number must stay."""


BEFORE_O: Mapping[str, str] = {
    "baseline constant-torque": "baseline --controller constant-torque",
    "-o phases.csv": "--phases phases.csv",
    "-o report.md": "-o report.md --format md",
    "-o figures": "-o figures --format pdf-figures",
}
"""What is said otherwise to a checkout whose overview does not say that `-o` is the output."""


@dataclass(frozen=True)
class Case:
    """A few commands and what they need; see `bench/same_results.toml`."""

    commands: Sequence[str] = ()
    inputs: Sequence[str] = ()
    own: Sequence[str] = ()
    needs: Sequence[str] = ()


CASES_FILE = Path(__file__).with_suffix(".toml")


def read_cases() -> dict[str, Case]:
    """The cases by name, each after those that it needs."""
    return {name: Case(**case) for name, case in tomllib.loads(CASES_FILE.read_text("utf-8")).items()}


@dataclass(frozen=True)
class Side:
    """One of the two checkouts, and where its results go."""

    name: str
    checkout: Path
    published: Path
    """The checkout that inputs are copied from."""
    folder: Path
    study: str
    """The command that runs a study."""
    before_o: bool
    """Whether its commands need the words of `BEFORE_O`."""

    @staticmethod
    def of(checkout: Path, published: Path, keep: Path, name: str) -> Side:
        """A checkout and the commands that it has; exits if it holds no package that can be imported."""
        checkout = checkout.resolve()
        script = "import coachable.cli; print(coachable.__file__); coachable.cli.main(['--help'])"
        done = _python(["-c", script], checkout)
        place, _, overview = done.stdout.partition("\n")
        if done.returncode or not Path(place).resolve().is_relative_to(checkout):
            raise SystemExit(f"{checkout} holds no coachable that runs: {place or _end(done.stderr)}")
        study = "study" if re.search(r"^ +study ", overview, re.MULTILINE) else "train"
        before_o = "-o is the output" not in overview
        return Side(name, checkout, published.resolve(), keep.resolve() / name, study, before_o)

    def run(self, name: str, cases: Mapping[str, Case], needed: Sequence[Future[str]]) -> str:
        """Run a case, unless its results are there already; returns what went wrong, or nothing."""
        if any(future.result() for future in needed):
            return "a case that it needs failed"
        case, folder, stamp = cases[name], self.folder / name, self.folder / f"{name}.done"
        key = self._key(case, cases)
        if stamp.is_file() and stamp.read_text("utf-8") == key:
            return ""
        stamp.unlink(missing_ok=True)
        shutil.rmtree(folder, ignore_errors=True)
        folder.mkdir(parents=True)
        for source in self._sources(case):
            (shutil.copytree if source.is_dir() else shutil.copy)(source, folder / source.name)
        since, statuses = time.perf_counter(), []
        names = {"CHECKOUT": str(self.checkout), "STUDY": self.study, **(BEFORE_O if self.before_o else {})}
        for number, command in enumerate(case.commands, start=1):
            words = re.sub("|".join(map(re.escape, names)), lambda name: names[name[0]], command).split()
            # A process of its own: the states that Z3 finds depend on what it was given before.
            done = _python(["-m", "coachable.cli", *words], self.checkout, folder)
            # Negative verdicts have exit status 1, and so has what Python does not catch.
            if done.returncode not in (0, 1) or "Traceback" in done.stderr:
                return f"coachable {' '.join(words)}: exit status {done.returncode}: {_end(done.stderr)}"
            verb, suffix = (
                command.split()[0].replace("STUDY", "train"),
                "json" if "--json" in words else "txt",
            )
            (folder / f"printed-{number:02d}-{verb}.{suffix}").write_text(done.stdout, encoding="utf-8")
            statuses.append(f"{number:02d} {verb}: {done.returncode}\n")
        (folder / "exit-status.txt").write_text("".join(statuses), encoding="utf-8")
        stamp.write_text(key, encoding="utf-8")
        print(f"{self.name} {name}: {time.perf_counter() - since:.0f} s", file=sys.stderr, flush=True)
        return ""

    def _sources(self, case: Case) -> list[Path]:
        return [
            *(self.published / name for name in case.inputs),
            *(self.checkout / name for name in case.own),
        ]

    def _key(self, case: Case, cases: Mapping[str, Case]) -> str:
        """A hash of all that the results of a case depend on."""
        needed = [self._key(cases[name], cases) for name in case.needs]
        digest = hashlib.sha256(repr((case, needed, self.study, sys.version)).encode())
        for source in (self.checkout / "src", *self._sources(case)):
            for path in sorted(source.rglob("*")) if source.is_dir() else [source]:
                if path.is_file() and "__pycache__" not in path.parts:
                    digest.update(path.relative_to(source).as_posix().encode() + b"\0" + path.read_bytes())
        return digest.hexdigest()


def verdict(differences: Iterable[Difference], case: str, every: bool = False) -> tuple[bool, str]:
    """Whether a case is as expected, and its line: of each kind the first difference, or `every` one."""
    lines: dict[str, list[str]] = {"differs": [], "differs as intended": [], "new": []}
    for difference in differences:
        line = f"{difference.where}: {difference.what}"
        if why := _why(f"{case}/{difference.where}", difference.words_only):
            lines["differs as intended"].append(f"{line}: {why}")
        else:
            lines["new" if difference.addition else "differs"].append(line)
    told = [f"{kind}: {_shown(found, every)}" for kind, found in lines.items() if found]
    return not lines["differs"], "; ".join(told) or "same"


def compare(old: Side, new: Side, only: Sequence[str], jobs: int, every: bool) -> list[str]:
    """Run the cases with both checkouts and print a line of each; returns the names of those that differ."""
    cases, surprises = read_cases(), []
    wanted = {needed for name in only for needed in (name, *cases[name].needs)}
    with ThreadPoolExecutor(jobs) as pool:
        futures: dict[tuple[Side, str], Future[str]] = {}
        for side in (old, new):
            for name in filter(wanted.__contains__, cases):
                # A case follows those that it needs, so what its thread waits for is done or under way.
                needed = [futures[side, need] for need in cases[name].needs]
                futures[side, name] = pool.submit(side.run, name, cases, needed)
        for name in filter(only.__contains__, cases):
            errors = {side.name: futures[side, name].result() for side in (old, new)}
            if failed := [f"{side} fails: {error}" for side, error in errors.items() if error]:
                fine, line = False, "; ".join(failed)
            else:
                fine, line = verdict(compare_folders(old.folder / name, new.folder / name), name, every)
            print(f"{name:<24} {line}", flush=True)
            surprises += [] if fine else [name]
    return surprises


def main(arguments: Sequence[str] | None = None) -> None:
    """Run, compare and print; exits 1 if something differs that is not expected."""
    cases = read_cases()
    parser = argparse.ArgumentParser(
        "python -m bench.same_results", description=__doc__, formatter_class=argparse.RawTextHelpFormatter
    )
    parser.add_argument("checkouts", type=Path, nargs="*", metavar="OLD NEW", help="two checkouts")
    parser.add_argument("--only", nargs="+", metavar="NAME", choices=cases, default=[*cases], help="cases")
    parser.add_argument("--keep", type=Path, metavar="DIR", help="keep the results there, and reuse them")
    parser.add_argument("--jobs", type=int, default=2, metavar="N", help="cases run at once (default 2)")
    parser.add_argument("--all", action="store_true", help="print every difference")
    parser.add_argument("--list", action="store_true", help="print the cases and their commands")
    options = parser.parse_args(arguments)
    if options.list:
        for name, case in cases.items():
            print(name, *case.commands, sep="\n    ")
        return
    if len(options.checkouts) != 2:
        parser.error("give two checkouts: OLD NEW")
    old, new = options.checkouts
    names = [checkout.resolve().name for checkout in (old, new)]
    with tempfile.TemporaryDirectory() as temporary:
        keep = options.keep or Path(temporary)
        first = Side.of(old, old, keep, names[0])
        second = Side.of(new, old, keep, names[1] + "-again" * (names[0] == names[1]))
        surprises = compare(first, second, options.only, options.jobs, options.all)
    result = f"{len(surprises)} differ: {', '.join(surprises)}" if surprises else "all as expected"
    print(f"{len(options.only)} cases, {result}")
    sys.exit(int(bool(surprises)))


def _why(where: str, words_only: bool) -> str | None:
    """Why a difference is expected, if it is."""
    reasons = [*EXPECTED.items(), *(EXPECTED_WORDS.items() if words_only else ())]
    return next((why for pattern, why in reasons if fnmatchcase(where, pattern)), None)


def _shown(lines: Sequence[str], every: bool) -> str:
    if every:
        return "".join(f"\n    {line}" for line in lines)
    return lines[0] + (f" (and {len(lines) - 1} more)" if len(lines) > 1 else "")


def _python(
    words: Sequence[str], checkout: Path, folder: Path | None = None
) -> subprocess.CompletedProcess[str]:
    # Text is laid out for a terminal of this width, without colour.
    variables = os.environ | {"PYTHONPATH": str(checkout / "src"), "COLUMNS": "100", "NO_COLOR": "1"}
    command, stdin = [sys.executable, *words], subprocess.DEVNULL
    return subprocess.run(command, cwd=folder, env=variables, stdin=stdin, capture_output=True, text=True)


def _end(errors: str) -> str:
    """The last two lines that are more than a frame."""
    lines = [line.strip(" │") for line in errors.splitlines() if re.search(r"\w", line)]
    return " / ".join(lines[-2:])


if __name__ == "__main__":
    main()
