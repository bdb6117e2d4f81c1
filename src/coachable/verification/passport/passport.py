"""The gait passport: all that was measured of one closed loop, as a value and as a file."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path
from typing import Any, Literal

from coachable.envs.squashing import Deterministic
from coachable.foundation.data import json_text, parse_json, structure, unstructure
from coachable.foundation.errors import RunFolderError
from coachable.foundation.files import read_text, write_atomic
from coachable.plants.sampled import Clock
from coachable.rewards.setup import Semantics
from coachable.verification.gait.adherence import Adherence
from coachable.verification.gait.orbit import Orbit
from coachable.verification.gait.stability import Stability
from coachable.verification.proportion import Proportion
from coachable.verification.robustness.basin import Basin
from coachable.verification.robustness.pushes import Pushes

FORMAT_VERSION = 1
Level = Literal["quick", "full"]
LEVELS: tuple[Level, ...] = ("quick", "full")


@dataclass(frozen=True)
class Walker:
    """What the passport is about: a lane's learned policy, or a baseline."""

    name: str
    """The lane (`setup-seed`, with `-best` for the best policy) or the baseline."""
    setup: str | None
    seed: int | None
    which: Literal["last", "best"] | None
    policy_sha256: str | None
    """Of the file with the policy's weights; `None` for a baseline."""
    semantics: Semantics | None
    """Of a plant."""
    clock: Clock
    """Its own clock, with which a policy was trained."""
    environment: str | None = None
    """The id of its Gymnasium environment; `None` for a plant."""
    deterministic: Deterministic = "clipped-mean"
    """What a policy does when it does not explore."""
    memory: tuple[str, ...] = ()
    """What a policy of a plant observes behind the state; empty of a state feedback."""

    @property
    def no_section(self) -> str | None:
        """Why nothing is known of orbits, stability, basins and certificates; `None` for a plant."""
        if self.environment is None:
            return None
        return (
            f"no section: the physics of {self.environment} is not a plant of coachable, so its return map "
            "cannot be computed, and there is no orbit, no multipliers, no basin and no certificate"
        )


@dataclass(frozen=True)
class Orbits:
    """The gaits that a walker settles to from x₀ under the two clocks."""

    free: Orbit
    touchdown: Orbit


@dataclass(frozen=True)
class FallSearch:
    """A search for a fall within stated bounds, by CMA-ES with restarts and beside it at random."""

    within: str
    """What the walker may meet, in a sentence."""
    seconds: float
    """How long each walk lasts, at most."""
    walks: int
    """The budget of each of the two."""
    first_fall: int | None
    """In which walk CMA-ES first saw a fall."""
    first_fall_at_random: int | None
    """In which walk random search did."""
    least_margin: float
    """Of all walks of both; not positive where one falls, and small where one nearly does."""
    confirmed: int
    """Falls that were walked once more with the same end; kept as counterexamples."""
    unconfirmed: int
    """Falls that were not seen again."""


@dataclass(frozen=True)
class Certified:
    """An attempt at a certificate: a box around the gait that is proven to return into itself, or why not."""

    proven: bool
    radius: float
    """Half the box's width along each eigenvector [rad and rad/s]; 0 without a proof."""
    reach: float
    """How far images of the box reach, over the radius; NaN if nothing was checked."""
    strides: int
    """Steps after which the box returns; 0 without a gait that repeats itself."""
    reason: str
    """What the checker reports; without a proof, where it fails."""
    file: str | None
    """The certificate's name in the folder `certificates`, if it was written."""


@dataclass(frozen=True)
class Passport:
    """What is known of one walker, at one level; docs/passport.md explains each line."""

    walker: Walker
    level: Level
    adherence: Adherence
    """Of 100 s from x₀ with its own clock; in a Gymnasium environment, of its episodes."""
    orbits: Orbits | None
    """`None` in a Gymnasium environment; the walker's `no_section` is the reason."""
    stability: Stability | None
    """Of the orbit under the touchdown clock; `None` without a periodic one."""
    basins: tuple[Basin, ...]
    """For each set of starts, under its own clock; empty if there is no gait to reach."""
    pushes: Pushes | None
    """Level full, under its own clock; `None` if there is no gait to disturb."""
    baseline: str | None
    """What stands beside it in the table of pushes."""
    baseline_pushes: Pushes | None
    falls: tuple[FallSearch, ...] = ()
    """Level full, under its own clock; empty without a gait, where every episode terminates, in
    `released-code` semantics, and for a plant without a second statement."""
    certificate: Certified | None = None
    """With the touchdown clock, where one was requested."""

    @property
    def gait(self) -> Orbit | None:
        """The gait under its own clock; `None` without a section."""
        if self.orbits is None:
            return None
        return self.orbits.free if self.walker.clock == "free" else self.orbits.touchdown

    @property
    def certifiable(self) -> bool:
        """Whether it is a state feedback with a periodic, stable orbit with the touchdown clock, by the
        paper's rules."""
        stable = self.stability is not None and self.stability.verdict == "stable"
        periodic = self.orbits is not None and self.orbits.touchdown.kind == "periodic"
        return stable and periodic and self.walker.semantics == "paper" and not self.walker.memory

    @property
    def walks(self) -> bool:
        """Whether it was up after 100 s and still took steps; without a section, up in every episode."""
        return self.adherence.up if self.gait is None else self.gait.kind != "none"

    @property
    def verdict(self) -> str:
        """The passport in one sentence."""
        if self.orbits is None:
            return _episodes_verdict(self.adherence)
        if not self.adherence.up:
            return f"does not walk: it fell after {self.adherence.seconds:.2f} s"
        if not self.walks:
            return "does not walk: it is up after 100 s, but takes no steps any more"
        if self.stability is not None:
            steps = _steps(self.orbits.touchdown.num_steps)
            settles = f"settles to a gait that repeats every {steps} (touchdown clock)"
            return f"walks and {settles}, {self.stability.verdict}"
        if self.orbits.touchdown.kind == "none":
            return "walks, but falls when its clock restarts at touchdown"
        return "walks without repeating itself"


_DERIVED = {
    Walker: ("no_section",),
    Adherence: ("follows",),
    Orbit: ("speed",),
    Stability: ("largest", "error", "verdict", "kinks"),
    Proportion: ("share", "interval"),
}


def passport_path(folder: Path, name: str) -> Path:
    """Where the passport of a walker lies."""
    return folder / f"{name}.json"


def write_passport(folder: Path, passport: Passport) -> Path:
    """Write a passport into a folder, whole or not at all."""
    path = passport_path(folder, passport.walker.name)
    write_atomic(path, json_text(passport_data(passport)) + "\n")
    return path


def passport_data(passport: Passport) -> dict[str, Any]:
    """The passport as JSON has it, as docs/passport.md documents it."""
    return {"format_version": FORMAT_VERSION, **unstructure(passport, _DERIVED)}


def read_passport(path: Path) -> Passport:
    """The passport in a file.

    **Raises:** `RunFolderError` naming the file and what is wrong with it.
    """
    data = parse_json(read_text(path), str(path), RunFolderError)
    version = data.pop("format_version", None)
    if version != FORMAT_VERSION:
        raise RunFolderError(
            f"{path} has format_version {version!r}; this coachable reads {FORMAT_VERSION}. "
            "Delete it and verify the walker again"
        )
    try:
        return structure(Passport, data, f"{path} is damaged", RunFolderError, derived=_DERIVED)
    except RunFolderError as error:
        raise RunFolderError(f"{error}. Delete it and verify the walker again") from None


def _episodes_verdict(seen: Adherence) -> str:
    assert seen.episodes is not None, "adherence without a plant is of episodes"
    up = f"is up at the end of {seen.episodes.count} of {seen.episodes.total} episodes"
    completed = sum(seen.cycles.values())
    return f"{up} and completes {completed:,} described {'cycle' if completed == 1 else 'cycles'}"


def _steps(count: int) -> str:
    return "step" if count == 1 else f"{count} steps"
