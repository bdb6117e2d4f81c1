"""Rows that grow: what lanes log while they are trained."""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np

Columns = dict[str, np.ndarray]


class Log:
    """Columns of equal length to which rows are added; one thread may read while another one adds."""

    def __init__(self, columns: Columns | None = None):
        self._parts: list[Columns] = [columns] if columns else []

    def add(self, columns: Columns) -> None:
        """Add rows; the same columns every time."""
        self._parts.append(columns)

    @property
    def num_rows(self) -> int:
        """How many rows there are."""
        return sum(len(next(iter(part.values()))) for part in list(self._parts))

    def columns(self) -> Columns:
        """Every row so far, by column; no columns while there are no rows."""
        parts = list(self._parts)
        return {name: np.concatenate([part[name] for part in parts]) for name in parts[0]} if parts else {}

    def last(self, num_rows: int) -> Columns:
        """The last rows."""
        return {name: values[-num_rows:] for name, values in self.columns().items()}

    def arrays(self, prefix: str) -> dict[str, np.ndarray]:
        """The columns under names for a checkpoint."""
        return {prefix + name: values for name, values in self.columns().items()}

    @staticmethod
    def of(arrays: Mapping[str, np.ndarray], prefix: str) -> Log:
        """The inverse of `arrays`."""
        return Log({name.removeprefix(prefix): a for name, a in arrays.items() if name.startswith(prefix)})
