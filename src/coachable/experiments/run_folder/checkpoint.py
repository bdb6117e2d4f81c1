"""Arrays in safetensors files that know whether they are whole."""

from __future__ import annotations

import hashlib
import json
from collections.abc import Mapping
from pathlib import Path

import numpy as np
from safetensors import SafetensorError, safe_open
from safetensors.numpy import load, save

from coachable.foundation.errors import RunFolderError
from coachable.foundation.files import read_bytes, write_atomic


def save_arrays(path: Path, arrays: Mapping[str, np.ndarray], about: Mapping[str, object]) -> None:
    """Write arrays, and what they are about, with a digest over both."""
    contiguous = {name: np.asarray(array, order="C") for name, array in arrays.items()}
    text = json.dumps(about, sort_keys=True)
    write_atomic(path, save(contiguous, {"about": text, "sha256": _digest(contiguous, text)}))


def load_arrays(path: Path) -> tuple[dict[str, np.ndarray], dict]:
    """The arrays in a file, and what they are about.

    **Raises:** `RunFolderError` naming a file that is damaged.
    """
    try:
        arrays = load(read_bytes(path, most=None))
        with safe_open(path, "numpy") as file:
            metadata = file.metadata() or {}
        if metadata["sha256"] != _digest(arrays, metadata["about"]):
            raise KeyError("its digest does not fit")
        return arrays, json.loads(metadata["about"])
    except (SafetensorError, KeyError, ValueError) as error:
        raise RunFolderError(
            f"{path} is damaged: {error}. Remove it to train its lanes again from the start"
        ) from None


def _digest(arrays: Mapping[str, np.ndarray], about: str) -> str:
    digest = hashlib.sha256(about.encode())
    for name in sorted(arrays):
        array = arrays[name]
        digest.update(f"{name} {array.dtype} {array.shape}\n".encode())
        digest.update(array.tobytes())
    return digest.hexdigest()
