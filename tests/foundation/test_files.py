"""Files are written whole or not at all, and damage is named."""

import errno
import os

import numpy as np
import pyarrow as pa
import pyarrow.parquet as pq
import pytest

from coachable.experiments.plan import load_plan
from coachable.experiments.run_folder.schemas import schemas
from coachable.foundation import tables
from coachable.foundation.errors import PlanError, RunFolderError
from coachable.foundation.files import (
    hash_of,
    make_folder,
    read_bytes,
    read_text,
    write_atomic,
    written_beside,
)
from coachable.foundation.tables import table_bytes, table_from, table_of

SCHEMAS = schemas(load_plan("paper"))
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


@pytest.mark.parametrize("place", ["link.txt", "dangling.txt", "hard.txt"])
def test_a_link_is_replaced_and_never_written_through(tmp_path, place):
    victim = tmp_path / "victim.txt"
    victim.write_text("mine")
    (tmp_path / "link.txt").symlink_to(victim)
    (tmp_path / "dangling.txt").symlink_to(tmp_path / "nowhere.txt")
    os.link(victim, tmp_path / "hard.txt")
    write_atomic(tmp_path / place, "new")
    assert (tmp_path / place).read_text() == "new"
    assert not (tmp_path / place).is_symlink()
    assert victim.read_text() == "mine"
    assert not (tmp_path / "nowhere.txt").exists()


def test_what_is_no_file_is_not_replaced(tmp_path):
    os.mkfifo(tmp_path / "pipe.txt")
    (tmp_path / "folder.txt").mkdir()
    for name in ("pipe.txt", "folder.txt"):
        with pytest.raises(OSError, match=r"not a regular file|Is a directory") as raised:
            write_atomic(tmp_path / name, "new")
        assert raised.value.filename == str(tmp_path / name)
    assert sorted(os.listdir(tmp_path)) == ["folder.txt", "pipe.txt"]


def test_a_body_that_fails_leaves_the_old_file(tmp_path):
    path = tmp_path / "film.gif"
    path.write_text("old")

    def fail(failure):
        with written_beside(path) as beside:
            beside.write_text("half")
            raise failure

    for failure in (KeyboardInterrupt(), ValueError("half"), OSError("no error number")):
        with pytest.raises(type(failure)):
            fail(failure)
    assert path.read_text() == "old"
    assert os.listdir(tmp_path) == ["film.gif"]


def test_a_name_of_any_length_that_the_system_takes_can_be_written(tmp_path):
    write_atomic(tmp_path / ("n" * 251 + ".svg"), "new")


def test_a_folder_of_output_is_no_link(tmp_path):
    (tmp_path / "elsewhere").mkdir()
    (tmp_path / "passports").symlink_to(tmp_path / "elsewhere")
    with pytest.raises(RunFolderError, match="passports is a link"):
        make_folder(tmp_path, "passports")
    assert make_folder(make_folder(tmp_path, "policies").parent, "policies").is_dir()


@pytest.mark.parametrize("name", ["pipe", "zeros", "folder", "large"])
def test_only_regular_files_of_bounded_size_are_read(tmp_path, name):
    os.mkfifo(tmp_path / "pipe")
    (tmp_path / "zeros").symlink_to("/dev/zero")
    (tmp_path / "folder").mkdir()
    (tmp_path / "large").write_bytes(bytes(11))
    with pytest.raises(RunFolderError, match=f"{name} cannot be read: it (is not a regular file|has more)"):
        read_bytes(tmp_path / name, most=10)
    with (tmp_path / "sparse").open("wb") as file:
        file.truncate(1 << 40)
    with pytest.raises(RunFolderError, match="it has more than"):
        read_text(tmp_path / "sparse")
    (tmp_path / "link").symlink_to(tmp_path / "large")
    assert len(read_bytes(tmp_path / "link")) == 11


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


def test_a_table_that_unpacks_to_more_than_the_memory_is_refused(tmp_path):
    path = tmp_path / "survival.parquet"
    schema = pa.schema([("lane", pa.string())])

    def packed(texts, rows):
        sink = pa.BufferOutputStream()
        column = pa.DictionaryArray.from_arrays(pa.array(np.zeros(rows, np.int32)), pa.array(texts))
        pq.write_table(pa.table({"lane": column.cast(pa.string())}), sink, compression="zstd")
        return sink.getvalue().to_pybytes()

    many = packed(["orthant-0"], 200_000)
    assert len(table_from(many, path, schema)) == 200_000
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(tables, "MOST_BYTES", 1_000_000)
        with pytest.raises(RunFolderError, match=r"survival\.parquet cannot be read: it unpacks to"):
            table_from(many, path, schema)
        with pytest.raises(RunFolderError, match="the texts in its column 'lane' are too long"):
            table_from(packed(["x" * 20_000], 100), path, schema)


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
