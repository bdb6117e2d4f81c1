"""The table of a benchmark: rows of measurements under headings, as Markdown and as JSON."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from math import floor, log10

HEADER = ("", "figure", "CPU s", "wall s", "coachable against it", "asked for")


@dataclass(frozen=True)
class Row:
    """One measured program: what it is, what it reached, what that cost, and what it means for us."""

    title: str
    figure: str
    cpu: float
    wall: float
    comparison: str = ""
    asked_for: str = ""

    @property
    def cells(self) -> tuple[str, ...]:
        """The row as text."""
        return (
            self.title,
            self.figure,
            significant(self.cpu),
            significant(self.wall),
            self.comparison,
            self.asked_for,
        )


def markdown(rows: Sequence[Row]) -> str:
    """The rows as a Markdown table with aligned columns."""
    lines = [HEADER, *(row.cells for row in rows)]
    widths = [max(len(line[column]) for line in lines) for column in range(len(HEADER))]
    right = (False, True, True, True, True, True)

    def aligned(cells: Sequence[str]) -> str:
        padded = [
            cell.rjust(width) if flush else cell.ljust(width)
            for cell, width, flush in zip(cells, widths, right, strict=True)
        ]
        return f"| {' | '.join(padded)} |"

    rule = [
        "-" * (width - 1) + ":" if flush else "-" * width for width, flush in zip(widths, right, strict=True)
    ]
    return "\n".join([aligned(HEADER), aligned(rule), *(aligned(row.cells) for row in rows)])


def significant(value: float, digits: int = 3) -> str:
    """A number with so many digits, thousands set apart: 1,230,000, 45.6, 0.00789."""
    if value == 0:
        return "0"
    decimals = digits - 1 - floor(log10(abs(value)))
    return f"{round(value, decimals):,.{max(decimals, 0)}f}"
