"""Files are written whole or not at all, and damage is named."""

import errno
import os

import numpy as np
import pytest

from coachable.experiments.plan import load_plan
from coachable.experiments.run_folder.schemas import schemas
from coachable.foundation.errors import PlanError, RunFolderError
from coachable.foundation.files import hash_of, read_bytes, read_text, write_atomic
from coachable.foundation.tables import table_bytes, table_from, table_of

SCHEMAS = schemas(load_plan("paper").problem)
SURVIVAL = {"lane": ["orthant-3", "sparse-0"], "seconds_up": [100.0, 3.25], "perturbed_up": [1.0, 0.5]}


def test_a_failed_write_leaves_the_old_file_and_nothing_else(tmp_path, monkeypatch):
    path = tmp_path / "plan.toml"
    write_atomic(path, "old")

    def full_disk(descriptor):
        raise OSError("no space left")

    monkeypatch.setattr(os, "fsync", full_disk)
    with pytest.raises(OSError, match="no space"):
        write_atomic(path, "new")
    assert path.read_text() == "old"
    assert os.listdir(tmp_path) == ["plan.toml"]


def test_a_full_disk_is_told_with_the_file(tmp_path, monkeypatch):
    def full_disk(descriptor):
        raise OSError(errno.ENOSPC, os.strerror(errno.ENOSPC))

    monkeypatch.setattr(os, "fsync", full_disk)
    with pytest.raises(OSError, match="No space left") as raised:
        write_atomic(tmp_path / "plan.toml", "new")
    assert raised.value.filename == str(tmp_path / "plan.toml")
    with pytest.raises(FileNotFoundError) as raised:
        write_atomic(tmp_path / "nowhere" / "plan.toml", "new")
    assert raised.value.filename == str(tmp_path / "nowhere" / "plan.toml")


def test_a_missing_and_a_changed_file_are_named(tmp_path):
    path = tmp_path / "plan.toml"
    with pytest.raises(RunFolderError, match=r"plan\.toml is missing"):
        read_bytes(path)
    write_atomic(path, b"one")
    assert read_bytes(path, hash_of(b"one")) == b"one"
    with pytest.raises(RunFolderError, match=r"plan\.toml is damaged"):
        read_bytes(path, hash_of(b"two"))


def test_text_is_read_as_utf_8_and_the_caller_chooses_the_error(tmp_path):
    path = tmp_path / "plan.toml"
    write_atomic(path, "θ")
    assert read_text(path, hash_of("θ".encode())) == "θ"
    path.write_bytes(b"\xff")
    with pytest.raises(PlanError, match=r"plan\.toml is damaged: it is not text in UTF-8"):
        read_text(path, error=PlanError)
    with pytest.raises(PlanError, match="cannot be read"):
        read_text(tmp_path, error=PlanError)


def test_a_table_comes_back_with_its_types_and_units(tmp_path):
    path, schema = tmp_path / "survival.parquet", SCHEMAS["survival"]
    data = table_bytes(table_of(SCHEMAS["survival"], SURVIVAL))
    table = table_from(data, path, schema)
    assert table.to_pydict() == SURVIVAL
    assert table.schema.equals(schema, check_metadata=True)
    assert table_bytes(table_of(SCHEMAS["survival"], SURVIVAL)) == data
    with pytest.raises(RunFolderError, match=r"survival\.parquet is damaged"):
        table_from(data[: len(data) // 2], path, schema)
    with pytest.raises(RunFolderError, match=r"survival\.parquet lacks the column 'step'"):
        table_from(data, path, SCHEMAS["evaluations"])


def test_nullable_columns_may_be_missing_from_an_older_table_and_nan_is_null(tmp_path):
    path, schema = tmp_path / "episodes.parquet", SCHEMAS["episodes"]
    rows = {
        "lane": ["a", "b"],
        "end_step": [5, 9],
        "return": [1.0, 2.0],
        "length": [5, 4],
        "fell": [True, False],
    }
    table = table_of(schema, rows | {"approx_kl": np.array([0.5, np.nan])})
    assert table["approx_kl"].to_pylist() == [0.5, None]
    assert table["entropy"].to_pylist() == [None, None]
    older = table_from(table_bytes(table.drop_columns(["approx_kl", "std"])), path, schema)
    assert set(older.column_names) == set(schema.names)
    assert older["approx_kl"].to_pylist() == [None, None]
    assert np.isnan(older["approx_kl"].to_numpy()).all()
    assert older["approx_kl"].to_numpy().dtype == np.float32
    assert older.select(list(rows)).to_pydict() == rows
