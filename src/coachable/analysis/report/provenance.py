"""Where a study comes from and how to have it again."""

from __future__ import annotations

import json
from dataclasses import dataclass
from typing import Any

from coachable.analysis.report.study import StudyReport


@dataclass(frozen=True)
class Provenance:
    """What a reader needs to trust and to repeat a study, as text."""

    label: str
    plan: str
    """The resolved plan as TOML."""
    commands: str
    made_with: tuple[tuple[str, str], ...]
    reward_hashes: tuple[tuple[str, str], ...]
    file_hashes: tuple[tuple[str, str], ...]
    num_policy_files: int


def provenance(study: StudyReport) -> Provenance:
    """The provenance of a study, from its manifest."""
    manifest, plan = study.run.manifest, study.run.experiment
    hashes = {name: digest for name, digest in manifest["files"].items() if not name.startswith("policies/")}
    out = f"runs/{study.run.path.resolve().name}"
    commands = [
        "# with the plan below saved as plan.toml",
        f"coachable train plan.toml --out {out}",
        f"coachable table {out}",
        f"coachable report {out}",
        *([f"coachable gait {out}"] if study.run.has_table("gaits") else []),
        study.watch_command,
    ]
    made = dict(manifest["versions"]) | dict(manifest["platform"])
    made["commit"] = manifest.get("git_commit")
    made["lanes side by side"] = manifest["device_layout"].get(
        "batch_sizes", manifest["device_layout"].get("group_widths")
    )
    made["wall time"] = _seconds(manifest.get("wall_seconds"))
    made["processor time"] = _seconds(manifest.get("cpu_seconds"))
    if manifest["resumed_under"]:
        made["resumed under other conditions"] = f"{len(manifest['resumed_under'])} times"
    return Provenance(
        label=study.label,
        plan=plan.to_toml(),
        commands="\n".join(commands),
        made_with=tuple((name, _plain(value)) for name, value in made.items() if value is not None),
        reward_hashes=tuple(manifest["reward_hashes"].items()),
        file_hashes=tuple(hashes.items()),
        num_policy_files=len(manifest["files"]) - len(hashes),
    )


def _plain(value: Any) -> str:
    return value if isinstance(value, str) else json.dumps(value, ensure_ascii=False)


def _seconds(seconds: float | None) -> str | None:
    if seconds is None:
        return None
    return f"{seconds / 60:.1f} min" if seconds >= 60 else f"{seconds:.1f} s"
