"""Pytrees of arrays as arrays by name, as they lie in files."""

from __future__ import annotations

from collections.abc import Mapping
from typing import TypeVar

import jax
import numpy as np

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
