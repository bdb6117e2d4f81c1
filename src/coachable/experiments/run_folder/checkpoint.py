"""Pytrees of arrays in safetensors files that know whether they are whole."""

from __future__ import annotations

import hashlib
import json
from collections.abc import Mapping
from pathlib import Path
from typing import TypeVar

import jax
import numpy as np
from safetensors import SafetensorError, safe_open
from safetensors.numpy import load, save

from coachable.foundation.errors import RunFolderError
from coachable.foundation.files import read_bytes, write_atomic

Tree = TypeVar("Tree")


def arrays_of(tree: object, prefix: str) -> dict[str, np.ndarray]:
    """The tree's leaves by their path in it."""
    leaves, _ = jax.tree_util.tree_flatten_with_path(tree)
    return {prefix + jax.tree_util.keystr(path): np.asarray(leaf) for path, leaf in leaves}


def tree_from(template: Tree, arrays: Mapping[str, np.ndarray], prefix: str) -> Tree:
    """The inverse of `arrays_of` for a tree shaped like `template`.

    **Raises:** `KeyError` for a leaf that is not there or has another shape or type.
    """
    leaves, structure = jax.tree_util.tree_flatten_with_path(template)
    found = []
    for path, leaf in leaves:
        array = arrays[name := prefix + jax.tree_util.keystr(path)]
        if (array.shape, array.dtype) != (leaf.shape, leaf.dtype):
            raise KeyError(f"{name} is {array.dtype}{list(array.shape)}, not {leaf.dtype}{list(leaf.shape)}")
        found.append(array)
    return jax.tree_util.tree_unflatten(structure, found)


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
