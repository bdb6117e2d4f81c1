"""Files are written whole or not at all, damage is named, and a folder has one writer."""

import errno
import os
import subprocess
import sys

import jax
import jax.numpy as jnp
import numpy as np
import pytest

from coachable.experiments.run_folder.checkpoint import arrays_of, load_arrays, save_arrays, tree_from
from coachable.experiments.run_folder.lock import locked
from coachable.experiments.run_folder.schemas import SCHEMAS, table_of
from coachable.foundation.errors import RunFolderError
from coachable.foundation.files import hash_of, read_bytes, table_bytes, table_from, write_atomic

TREE = {
    "weights": (jnp.arange(6.0).reshape(2, 3), jnp.float32(2.0)),
    "count": jnp.int32(3),
    "key": jnp.uint32([1, 2]),
}
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


def test_a_tree_goes_through_a_checkpoint_to_the_bit(tmp_path):
    path = tmp_path / "group-000.safetensors"
    save_arrays(path, arrays_of(TREE, "state"), {"updates": 7})
    arrays, about = load_arrays(path)
    again = tree_from(TREE, arrays, "state")
    assert about == {"updates": 7}
    jax.tree.map(np.testing.assert_array_equal, again, TREE)


@pytest.mark.parametrize("where", [10, 200, -5])
def test_one_changed_byte_anywhere_in_a_checkpoint_is_noticed(tmp_path, where):
    path = tmp_path / "group-000.safetensors"
    save_arrays(path, arrays_of(TREE, "state"), {"updates": 7})
    data = bytearray(path.read_bytes())
    data[where] ^= 1
    path.write_bytes(data)
    with pytest.raises(RunFolderError, match=r"group-000\.safetensors is damaged"):
        load_arrays(path)


def test_a_tree_of_another_shape_is_refused():
    arrays = arrays_of(TREE, "state")
    with pytest.raises(KeyError, match="weights"):
        tree_from(TREE | {"weights": (jnp.zeros((3, 2)), jnp.float32(0))}, arrays, "state")


def test_two_writers_cannot_hold_one_folder(tmp_path):
    with locked(tmp_path):
        with pytest.raises(RunFolderError, match=f"process {os.getpid()}"), locked(tmp_path):
            pass
        assert (tmp_path / "lock").exists()
    assert not (tmp_path / "lock").exists()
    with locked(tmp_path):
        pass


def test_a_lock_dies_with_its_holder(tmp_path):
    program = (
        "import os, sys, pathlib\nfrom coachable.experiments.run_folder.lock import locked\n"
        "with locked(pathlib.Path(sys.argv[1])):\n    os.kill(os.getpid(), 9)\n"
    )
    done = subprocess.run([sys.executable, "-c", program, str(tmp_path)], check=False)
    assert done.returncode == -9
    assert (tmp_path / "lock").exists()
    with locked(tmp_path):
        assert (tmp_path / "lock").read_text() == f"{os.getpid()}\n"
