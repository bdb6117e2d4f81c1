"""What a run was made with: versions, machine, commit. Kept in its manifest, compared when it is resumed."""

from __future__ import annotations

import platform
import subprocess
from importlib import metadata
from pathlib import Path
from typing import Any

import jax

PACKAGES = (
    "coachable",
    "jax",
    "jaxlib",
    "equinox",
    "numpy",
    "pyarrow",
    "safetensors",
    "gymnasium",
    "mujoco",
    "stable-baselines3",
    "torch",
)
"""Those that are not installed have no version."""
DECIDE_BITS = ("coachable", "jax", "jaxlib")
"""Packages whose version can change the last bits of what is computed."""


def environment() -> dict[str, Any]:
    """Versions, platform and commit, ready for JSON."""
    return {
        "versions": {"python": platform.python_version()} | {name: _version(name) for name in PACKAGES},
        "platform": {
            "system": platform.system(),
            "machine": platform.machine(),
            "processor": _processor(),
            "backend": jax.default_backend(),
        },
        "git_commit": _git_commit(),
    }


def environment_differences(before: dict[str, Any], now: dict[str, Any]) -> list[str]:
    """One line for each thing in which two environments differ that can change the bits of a result."""
    then = {name: before["versions"].get(name) for name in DECIDE_BITS} | before["platform"]
    here = {name: now["versions"].get(name) for name in DECIDE_BITS} | now["platform"]
    return [f"{key}: {then.get(key)} → {here[key]}" for key in here if then.get(key) != here[key]]


def _version(package: str) -> str | None:
    try:
        return metadata.version(package)
    except metadata.PackageNotFoundError:
        return None


def _processor() -> str:
    # The instructions that XLA compiles for depend on the processor's model, which `platform` knows only on a
    # Mac.
    try:
        lines = Path("/proc/cpuinfo").read_text(encoding="utf-8").splitlines()
    except OSError:
        return platform.processor()
    names = [line.partition(":")[2].strip() for line in lines if line.startswith("model name")]
    return names[0] if names else platform.processor()


def _git_commit() -> str | None:
    """The commit of the checkout this package lies in, marked if files differ from it; None outside one."""
    here = Path(__file__)

    def git(*arguments: str) -> str | None:
        try:
            done = subprocess.run(
                ["git", "-C", str(here.parent), *arguments],
                capture_output=True,
                text=True,
                timeout=10,
                check=False,
            )
        except (OSError, subprocess.TimeoutExpired):
            return None
        return done.stdout.strip() if done.returncode == 0 else None

    if git("ls-files", "--error-unmatch", here.name) is None:
        return None
    return git("describe", "--always", "--dirty", "--abbrev=40", "--exclude=*")
