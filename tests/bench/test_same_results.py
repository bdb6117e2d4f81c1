"""Two folders of results are the same to the bit, or what differs is named."""

import json
import shutil

import numpy as np
import pyarrow as pa
import pyarrow.parquet as pq
import pytest
from safetensors.numpy import save_file

from bench import same_results
from bench.differences import compare_folders
from bench.same_results import read_cases, verdict

PRINTED = "speed 0.40 m/s\nfell never\n"
COLUMNS = {
    "lane": ["orthant-0", "orthant-1", "orthant-1"],
    "hip_x": np.array([0.5, np.nan, 0.0], np.float32),
    "fell": [True, False, False],
}
WEIGHTS = {"weight": np.arange(6, dtype=np.float32).reshape(2, 3), "bias": np.zeros(2, np.float32)}
PASSPORT = {"walker": {"name": "orthant-0", "seed": 0}, "basins": [{"reached": 7}, {"reached": 9}]}


def write(
    folder, columns=COLUMNS, weights=WEIGHTS, passport=PASSPORT, printed="speed 0.40 m/s\nfell never\n"
):
    (folder / "policies").mkdir(parents=True, exist_ok=True)
    pq.write_table(pa.table(dict(columns)), folder / "evaluations.parquet")
    save_file(weights, folder / "policies" / "orthant-0-last.safetensors")
    (folder / "passport.json").write_text(json.dumps(passport))
    (folder / "printed.txt").write_text(printed)
    (folder / "gait.gif").write_bytes(bytes(range(100)))
    return folder


@pytest.fixture
def old(tmp_path):
    return write(tmp_path / "old")


@pytest.fixture
def new(tmp_path):
    return write(tmp_path / "new")


def differences(old, new):
    return {one.where: one for one in compare_folders(old, new)}


def test_equal_folders_are_the_same(old, new):
    assert compare_folders(old, new) == []


def test_how_a_table_is_stored_does_not_matter(old, new):
    pq.write_table(pa.table(dict(COLUMNS)), new / "evaluations.parquet", compression="none", row_group_size=1)
    assert compare_folders(old, new) == []


@pytest.mark.parametrize("cell", [np.nextafter(np.float32(0.5), np.float32(1)), -0.5, np.nan])
def test_a_changed_cell_is_named(old, new, cell):
    write(new, COLUMNS | {"hip_x": np.array([cell, np.nan, 0.0], np.float32)})
    (found,) = compare_folders(old, new)
    assert found.where == "evaluations.parquet:hip_x"
    assert found.what == f"row 0: {np.float32(0.5)!r} → {np.float32(cell)!r} (1 of 3 differ)"


def test_zero_is_not_minus_zero(old, new):
    write(new, COLUMNS | {"hip_x": np.array([0.5, np.nan, -0.0], np.float32)})
    assert "row 2" in differences(old, new)["evaluations.parquet:hip_x"].what


def test_a_changed_word_in_a_column_is_named(old, new):
    write(new, COLUMNS | {"lane": ["orthant-0", "orthant-1", "orthant-2"]})
    what = differences(old, new)["evaluations.parquet:lane"].what
    assert what == "row 2: 'orthant-1' → 'orthant-2' (1 of 3 differ)"


def test_missing_and_new_columns_are_distinguished(old, new):
    write(new, {"lane": COLUMNS["lane"], "kl": np.zeros(3), "hip_x": COLUMNS["hip_x"].astype(np.float64)})
    found = differences(old, new)
    assert found["evaluations.parquet:fell"].what == "the column is missing"
    assert found["evaluations.parquet:hip_x"].what == "float32[3] → float64[3]"
    assert [where for where, one in found.items() if one.addition] == ["evaluations.parquet:kl"]


def test_a_changed_weight_is_named_with_its_place(old, new):
    changed = WEIGHTS["weight"] + np.array([[0, 0, 0], [0, 1, 0]], np.float32)
    write(new, weights=WEIGHTS | {"weight": changed})
    (found,) = compare_folders(old, new)
    assert found.where == "policies/orthant-0-last.safetensors:weight"
    assert found.what.startswith("row 1, 1: ")


def test_a_changed_key_is_named(old, new):
    write(new, passport=PASSPORT | {"basins": [{"reached": 7}, {"reached": 8, "of": 10}]})
    found = differences(old, new)
    assert found["passport.json:basins[1].reached"].what == "'9' → '8'"
    assert found["passport.json:basins[1].of"].addition


def test_words_are_distinguished_from_numbers(old, new):
    write(new, printed="speed 0.40 m/s\nno fall\n")
    found = differences(old, new)["printed.txt"]
    assert found.words_only
    assert found.what.startswith("line 2: 'fell never' → 'no fall'")
    write(new, printed="speed -0.40 m/s\nfell never\n")
    assert not differences(old, new)["printed.txt"].words_only
    write(new, printed="speed 0.41 m/s\nno fall\n")
    found = differences(old, new)["printed.txt"]
    assert not found.words_only
    assert "0.40 → 0.41" in found.what


def test_a_changed_byte_is_found(old, new):
    data = bytearray((new / "gait.gif").read_bytes())
    data[42] ^= 1
    (new / "gait.gif").write_bytes(data)
    assert differences(old, new)["gait.gif"].what == "from byte 42 on; 100 → 100 bytes"


def test_missing_and_new_files_are_distinguished(old, new):
    (new / "gait.gif").rename(new / "gait.mp4")
    found = differences(old, new)
    assert found["gait.gif"].what == "the file is missing"
    assert found["gait.mp4"].addition


def test_of_a_manifest_only_results_count(old, new):
    manifest = {"status": "complete", "wall_seconds": 1.0, "reward_hashes": {"orthant": "ab"}}
    (old / "manifest.json").write_text(json.dumps(manifest))
    (new / "manifest.json").write_text(json.dumps(manifest | {"wall_seconds": 2.0}))
    assert compare_folders(old, new) == []
    (new / "manifest.json").write_text(json.dumps(manifest | {"reward_hashes": {"orthant": "cd"}}))
    assert [*differences(old, new)] == ["manifest.json:reward_hashes.orthant"]


def test_only_what_is_expected_is_excused(old, new, monkeypatch):
    write(new, COLUMNS | {"kl": np.zeros(3)}, printed="speed 0.40 m/s\nno fall\n")
    assert verdict(compare_folders(old, new), "walkers")[0] is False
    monkeypatch.setattr(same_results, "EXPECTED_WORDS", {"walkers/printed*.txt": "plainer words"})
    fine, line = verdict(compare_folders(old, new), "walkers")
    assert fine
    assert "differs as intended: printed.txt: line 2" in line
    assert line.endswith("new: evaluations.parquet:kl: a new column")
    assert "plainer words" in line
    write(new, printed="speed 0.41 m/s\nno fall\n")
    assert verdict(compare_folders(old, new), "walkers")[0] is False
    monkeypatch.setattr(same_results, "EXPECTED", {"walkers/printed.txt": "another integrator"})
    assert verdict(compare_folders(old, new), "walkers")[0] is True


def test_every_case_follows_those_that_it_needs():
    before = []
    for name, case in read_cases().items():
        assert set(case.needs) <= set(before)
        before.append(name)


@pytest.fixture
def checkout(tmp_path):
    """A checkout with one command, `train`."""
    package = tmp_path / "checkout" / "src" / "coachable"
    package.mkdir(parents=True)
    (package / "__init__.py").write_text("")
    (package / "cli.py").write_text(
        "import sys\n"
        "def main(words):\n"
        "    if words == ['--help']:\n"
        "        return print('  train     Train.')\n"
        "    print(words, 1)\n"
        "    if words[0] != 'train':\n"
        "        print('there is no such command', file=sys.stderr)\n"
        "        sys.exit(2)\n"
        "if __name__ == '__main__':\n"
        "    main(sys.argv[1:])\n"
    )
    return tmp_path / "checkout"


def test_only_changed_cases_run_again(checkout, tmp_path, monkeypatch, capfd):
    cases = tmp_path / "cases.toml"
    cases.write_text('[one]\ncommands = ["STUDY paper"]\n[two]\nneeds = ["one"]\ncommands = ["train x"]\n')
    monkeypatch.setattr(same_results, "CASES_FILE", cases)
    other = tmp_path / "other"
    shutil.copytree(checkout, other)

    def outcome():
        with pytest.raises(SystemExit) as end:
            same_results.main([str(checkout), str(other), "--keep", str(tmp_path / "keep")])
        printed = capfd.readouterr()
        return end.value.code, printed.out.splitlines(), len(printed.err.splitlines())

    assert outcome() == (0, [f"{'one':<24} same", f"{'two':<24} same", "2 cases, all as expected"], 4)
    assert outcome()[2] == 0
    program = other / "src" / "coachable" / "cli.py"
    program.write_text(program.read_text().replace("words, 1", "words, 2"))
    code, lines, runs = outcome()
    assert (code, runs) == (1, 2)
    assert "printed-01-train.txt: line 1" in lines[0]
    program.write_text(program.read_text().replace("'train':", "'study':"))
    code, lines, _ = outcome()
    assert code == 1
    assert lines[0].endswith("other fails: coachable train paper: exit status 2: there is no such command")
    assert "a case that it needs failed" in lines[1]
