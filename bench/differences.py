"""Compare two folders of results file by file: tables and tensors to the bit, JSON by key, text by line."""

from __future__ import annotations

import json
import re
from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from itertools import zip_longest
from pathlib import Path
from typing import Any

import numpy as np
import pyarrow as pa
import pyarrow.parquet as pq
from safetensors.numpy import load_file

SKIPPED = ("plan.toml", "lock")
"""Files of a run folder that record how it was started, and not what it computed."""

RESULTS_IN_MANIFEST = ("reward_hashes", "baseline")
"""A manifest's keys that are results; the others hold times, versions, and hashes of files compared here."""

TEXT = (".behaviour", ".bib", ".csv", ".dot", ".html", ".kyx", ".md", ".mmd", ".py", ".svg", ".txt", ".xml")

_NUMBER = re.compile(r"[-−]?(?:\d+(?:\.\d+)?(?:[eE][-+]?\d+)?|\b(?:nan|inf)\b)")
_SHOWN = 90


@dataclass(frozen=True)
class Difference:
    """One thing in which two folders differ."""

    where: str
    """The file and, after a colon, the column, tensor or key."""
    what: str
    """Row or line, and both values: old → new."""
    addition: bool = False
    """The new folder has something more; everything that the old one has may still be the same."""
    words_only: bool = False
    """The text differs, but every number in it is the same."""


def compare_folders(old: Path, new: Path) -> list[Difference]:
    """Differences between two folders, file by file in the order of their names."""
    before, after = _files(old), _files(new)
    found = [difference for name in before for difference in compare_files(name, old, new)]
    return found + [Difference(name, "a new file", addition=True) for name in after if name not in before]


def compare_files(name: str, old: Path, new: Path) -> Iterator[Difference]:
    """Differences between the files called `name` in two folders; the old folder has it."""
    first, second = old / name, new / name
    if not second.is_file():
        yield Difference(name, "the file is missing")
        return
    if first.read_bytes() == second.read_bytes():
        return
    match first.suffix:
        case ".parquet":
            yield from compare_tables(name, pq.read_table(first), pq.read_table(second))
        case ".safetensors":
            yield from compare_arrays(name, load_file(first), load_file(second), "tensor")
        case ".json":
            yield from compare_json(name, _json_of(first), _json_of(second))
        case suffix if suffix in TEXT:
            yield from compare_text(name, first.read_text("utf-8"), second.read_text("utf-8"))
        case _:
            yield compare_bytes(name, first.read_bytes(), second.read_bytes())


def compare_tables(name: str, old: pa.Table, new: pa.Table) -> Iterator[Difference]:
    """Differences between the columns of two tables, to the bit."""
    before, after = ({key: table[key].to_numpy() for key in table.column_names} for table in (old, new))
    yield from compare_arrays(name, before, after, "column")


def compare_arrays(
    name: str, old: Mapping[str, np.ndarray], new: Mapping[str, np.ndarray], kind: str
) -> Iterator[Difference]:
    """Differences between arrays by name, to the bit: NaN equals itself, 0 does not equal −0."""
    for key, first in old.items():
        where = f"{name}:{key}"
        if key not in new:
            yield Difference(where, f"the {kind} is missing")
            continue
        second = new[key]
        shapes = [f"{array.dtype}{list(array.shape)}" for array in (first, second)]
        if shapes[0] != shapes[1]:
            yield Difference(where, f"{shapes[0]} → {shapes[1]}")
            continue
        flat, other = np.ravel(first), np.ravel(second)
        differs = flat != other if flat.dtype == object else (_bits(flat) != _bits(other)).any(axis=1)
        if differs.any():
            row = int(np.argmax(differs))
            place = ", ".join(str(index) for index in np.unravel_index(row, first.shape))
            values = f"{flat[row]!r} → {other[row]!r}"
            yield Difference(where, f"row {place}: {values} ({differs.sum()} of {differs.size} differ)")
    for key in new:
        if key not in old:
            yield Difference(f"{name}:{key}", f"a new {kind}", addition=True)


def compare_json(name: str, old: Any, new: Any, path: str = "") -> Iterator[Difference]:
    """Differences between two JSON values, one for each key or item that is not the same."""
    where = f"{name}:{path}" if path else name
    if isinstance(old, dict) and isinstance(new, dict):
        for key in old | new:
            inner = f"{path}.{key}".lstrip(".")
            if key not in new:
                yield Difference(f"{name}:{inner}", "the key is missing")
            elif key not in old:
                yield Difference(f"{name}:{inner}", "a new key", addition=True)
            else:
                yield from compare_json(name, old[key], new[key], inner)
    elif isinstance(old, list) and isinstance(new, list) and len(old) == len(new):
        for index, (first, second) in enumerate(zip(old, new, strict=True)):
            yield from compare_json(name, first, second, f"{path}[{index}]")
    elif json.dumps(old) != json.dumps(new):
        words_only = isinstance(old, str) and isinstance(new, str) and _numbers(old) == _numbers(new)
        yield Difference(where, _values(json.dumps(old), json.dumps(new)), words_only=words_only)


def compare_text(name: str, old: str, new: str) -> Iterator[Difference]:
    """The first line in which two texts differ, as one difference."""
    if old == new:
        return
    lines, others = old.splitlines(), new.splitlines()
    both = zip(lines, others, strict=False)
    line = next((i for i, (a, b) in enumerate(both) if a != b), min(len(lines), len(others)))
    first, second = ((*text[line : line + 1], "(the end)")[0] for text in (lines, others))
    numbers = zip_longest(_numbers(old), _numbers(new), fillvalue="none")
    number = next((f"{a} → {b}" for a, b in numbers if a != b), None)
    also = "the numbers are the same" if number is None else f"first number that differs: {number}"
    yield Difference(name, f"line {line + 1}: {_values(first, second)} ({also})", words_only=number is None)


def compare_bytes(name: str, old: bytes, new: bytes) -> Difference:
    """The first byte in which two different files differ."""
    both = zip(old, new, strict=False)
    byte = next((i for i, (a, b) in enumerate(both) if a != b), min(len(old), len(new)))
    return Difference(name, f"from byte {byte} on; {len(old)} → {len(new)} bytes")


def _files(folder: Path) -> list[str]:
    paths = (path for path in folder.rglob("*") if path.is_file() and path.name not in SKIPPED)
    return sorted(path.relative_to(folder).as_posix() for path in paths)


def _json_of(path: Path) -> Any:
    data = json.loads(path.read_text("utf-8"))
    if path.name != "manifest.json":
        return data
    return {key: data[key] for key in RESULTS_IN_MANIFEST if key in data}


def _bits(array: np.ndarray) -> np.ndarray:
    return np.ascontiguousarray(array).view(np.uint8).reshape(array.size, array.dtype.itemsize)


def _numbers(text: str) -> list[str]:
    return _NUMBER.findall(text)


def _values(old: str, new: str) -> str:
    """Both values, each from a little before the place where they part."""
    part = next((i for i, (a, b) in enumerate(zip(old, new, strict=False)) if a != b), 0)
    start = max(0, part - _SHOWN // 3)
    shown = [("…" if start else "") + text[start : start + _SHOWN] for text in (old, new)]
    return f"{shown[0]!r} → {shown[1]!r}"
