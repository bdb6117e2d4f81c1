"""The page as text: its numbers are those of the Parquet files, its texts are escaped, damage is named."""

import base64
import hashlib
import html
import json
import math
import re
import shutil
from pathlib import Path

import numpy as np
import pyarrow as pa
import pyarrow.parquet as pq
import pytest

from coachable.analysis.report import page as page_module
from coachable.analysis.report.formats import write
from coachable.analysis.report.page import read_studies, render, write_report
from coachable.analysis.report.walks import even_selection
from coachable.behaviours.library import load_behaviour
from coachable.experiments.run_folder.schemas import DIAGNOSTICS
from coachable.foundation.errors import RunFolderError
from coachable.foundation.files import hash_of
from coachable.rewards.expected_run import ExpectedRunFollower

RESULTS = Path(__file__).parents[3] / "docs" / "results"
BIBTEX = "@software{coachable, title = {A & B <c>}}"


def quiet(doing):
    pass


def page_of(*paths):
    studies, problems = read_studies(paths, quiet)
    return render(studies, problems, BIBTEX)


def data_of(page):
    (text,) = re.findall(r'<script type="application/json" id="data">(.*?)</script>', page, re.DOTALL)
    return json.loads(text)["studies"]


@pytest.fixture(scope="module")
def page(four):
    return page_of(four)


@pytest.fixture(scope="module")
def several(make_run, tmp_path_factory):
    folder = tmp_path_factory.mktemp("several")
    return [
        make_run(folder / semantics, num_seeds=3, semantics=semantics)
        for semantics in ("paper", "released-code")
    ]


def cells(page, title):
    """The rows of every table under a title."""
    _, _, rest = page.partition(f"<h3>{html.escape(title)}</h3>")
    part = rest.partition("<h3>")[0]
    assert "<tr>" in part
    return [
        [html.unescape(re.sub("<.*?>", "", cell)) for cell in re.findall(r"<t[hd].*?>(.*?)</t[hd]>", row)]
        for row in re.findall(r"<tr>(.*?)</tr>", part, re.DOTALL)
    ]


def test_the_numbers_are_those_of_the_parquet_files(several):
    page = page_of(*several)
    found = iter(cells(page, "Walking distance after the last update [m]"))
    for path, column in zip(several, ("hip_x", "foot_x"), strict=True):
        evaluations = pq.read_table(path / "evaluations.parquet").to_pandas()
        last = evaluations[evaluations.step == evaluations.step.max()]
        assert next(found)[0] == "setup"
        for setup in ("sparse", "forward", "orthant", "forward+orthant"):
            own = last[last.lane.str.fullmatch(re.escape(setup) + r"-\d+")][column]
            name, mean, *_ = next(found)
            assert name == setup
            assert mean.split(" [")[0] == f"{own.mean():.2f}"


def test_every_lane_and_every_curve_is_that_of_the_parquet_files(several, in_node):
    for path, column, study in zip(several, ("hip_x", "foot_x"), data_of(page_of(*several)), strict=True):
        evaluations = pq.read_table(path / "evaluations.parquet").to_pandas()
        last = evaluations[evaluations.step == evaluations.step.max()].set_index("lane")
        for lane in study["lanes"]:
            assert lane["distance"] == pytest.approx(last[column][lane["name"]], abs=1e-4)
            assert lane["fell"] == last.fell[lane["name"]]
        for setup in study["setups"]:
            distances = [lane["distance"] for lane in study["lanes"] if lane["setup"] == setup]
            assert distances == sorted(distances, reverse=True)
        curve = next(curve for curve in study["curves"] if curve["key"] == "distance")
        for setup in curve["setups"]:
            for seed, values in in_node(
                "unpack(input).then((c) => Object.entries(c).map(([k, v]) => [k, Array.from(v)]))",
                setup["runs"],
            ):
                own = evaluations[evaluations.lane == f"{setup['name']}-{seed}"].sort_values("step")
                own = own[own.step <= 60_000]
                assert own.step.tolist() == curve["steps"]
                np.testing.assert_allclose(values, own[column], atol=2e-4)


def test_the_diagnostics_of_the_updates_are_those_of_the_parquet_file(four, page, in_node):
    (study,) = data_of(page)
    episodes = pq.read_table(four / "episodes.parquet").to_pandas()
    keys = [curve["key"] for curve in study["updates"]]
    assert keys == ["approx_kl", "clip_fraction", "explained_variance", "entropy"]
    expected, bands = [], []
    for curve in study["updates"]:
        for setup in curve["setups"]:
            own = episodes[episodes.lane == f"{setup['name']}-0"].sort_values("end_step")
            expected.append([own[own.end_step <= step][curve["key"]].iloc[-1] for step in curve["steps"]])
            bands.append(setup["band"])
    unpacked = "Promise.all(input.map(unpack)).then((all) => all.map((columns) => Array.from(columns.value)))"
    np.testing.assert_allclose(in_node(unpacked, bands), expected, atol=1e-4)


def test_a_run_without_diagnostics_has_no_curves_of_them(four, tmp_path):
    older = tmp_path / "older"
    shutil.copytree(four, older)
    table = pq.read_table(older / "episodes.parquet")
    pq.write_table(table.drop_columns(list(DIAGNOSTICS)), older / "episodes.parquet")
    manifest = json.loads((older / "manifest.json").read_text())
    manifest["files"]["episodes.parquet"] = hashlib.sha256(
        (older / "episodes.parquet").read_bytes()
    ).hexdigest()
    (older / "manifest.json").write_text(json.dumps(manifest))
    (study,) = data_of(page_of(older))
    assert study["updates"] == []
    assert study["curves"] == data_of(page_of(four))[0]["curves"]


def test_a_walk_is_that_of_the_parquet_file(four, page, in_node):
    (study,) = data_of(page)
    walks = pq.read_table(four / "trajectories.parquet").to_pandas()
    for lane in study["lanes"][:2]:
        stored = walks[walks.lane == lane["name"]]
        back = in_node(
            "unpack(input).then((c) => Object.entries(c).map(([k, v]) => [k, Array.from(v)]))", lane["walk"]
        )
        for name, column in back:
            half = 0.51 * dict(lane["walk"]["columns"])[name]
            np.testing.assert_allclose(column, stored[name], atol=half)


def test_where_phases_have_limits_the_expected_one_stands_beside_the_actual(
    make_run, four, page, in_node, tmp_path
):
    timed = load_behaviour("compass-walking-timed")
    folder = make_run(tmp_path / "timed", setups=["orthant"], behaviour=timed)
    (study,) = data_of(page_of(folder))
    walks = pq.read_table(folder / "trajectories.parquet").to_pandas()
    follower = ExpectedRunFollower(timed)
    for name, packed in (
        (study["lanes"][0]["name"], study["lanes"][0]["walk"]),
        ("virtual-gravity", study["baseline"]),
    ):
        stored = walks[walks.lane == name]
        columns = dict(
            in_node(
                "unpack(input).then((c) => Object.entries(c).map(([k, v]) => [k, Array.from(v)]))", packed
            )
        )
        expected = follower.along(stored["t"].to_numpy(float), stored["phase"].to_numpy(int))
        np.testing.assert_array_equal(columns["expected"], expected)
        assert 0.5 < np.mean(expected == stored["phase"]) < 1
    (without,) = data_of(page)
    assert "expected" not in dict(without["lanes"][0]["walk"]["columns"])


def test_the_policy_forbids_all_but_the_page_s_own_scripts(page):
    (policy,) = re.findall(r'http-equiv="Content-Security-Policy" content="(.*?)"', page)
    policy = html.unescape(policy)
    assert "default-src 'none'" in policy
    assert "unsafe-eval" not in policy
    scripts = re.findall(r"<script>(.*?)</script>", page, re.DOTALL)
    digests = [base64.b64encode(hashlib.sha256(script.encode()).digest()).decode() for script in scripts]
    assert re.findall(r"'sha256-(.*?)'", policy) == digests
    assert not re.search(
        r"""(src|href)=["'](?!#)""", re.sub(r"<script.*?</script>", "", page, flags=re.DOTALL)
    )


def test_texts_from_files_are_shown_and_not_read(make_run, script, tmp_path):
    page = page_of(make_run(tmp_path / "run", behaviour=script))
    outside = re.sub(r"<script>.*?</script>|<script type.*?</script>", "", page, flags=re.DOTALL)
    assert "<script" not in outside
    assert "<img" not in page
    assert "&lt;script&gt;window.pwned" in outside
    assert html.escape(BIBTEX) in page


def test_it_says_where_it_comes_from(page, four):
    manifest = json.loads((four / "manifest.json").read_text())
    for said in (
        manifest["versions"]["jax"],
        *manifest["reward_hashes"].values(),
        manifest["files"]["plan.toml"],
    ):
        assert said in page
    assert "coachable train plan.toml --out runs/four" in page
    assert re.search(r"hidden_sizes = \[\s*64,\s*64,?\s*\]", page)
    assert "passport" not in page


def test_the_table_of_passports_is_shown_with_the_others(four, tmp_path):
    run = shutil.copytree(four, tmp_path / "run")
    (run / "passports").mkdir()
    table = {
        "title": "Gait passports",
        "header": ["setup", "up", "proven"],
        "rows": [["<b>", "14", "14"]],
        "note": "up: 100 s",
    }
    (run / "passports" / "summary.json").write_text(json.dumps(table))
    page = page_of(run)
    assert "Gait passports" in page
    assert "&lt;b&gt;" in page
    assert "up: 100 s" in page
    assert "Gait passports (claimed, not re-checked)" in page
    assert "This page has re-checked none of these numbers" in page
    assert "<th>proven</th>" not in page
    assert "proof claimed" in page
    (run / "passports" / "summary.json").write_text("{")
    assert "summary.json is damaged" in page_of(run)


def test_a_damaged_folder_is_named_and_the_others_are_reported(four, tmp_path):
    broken = shutil.copytree(four, tmp_path / "broken")
    (broken / "plan.toml").write_text("steps = ?")
    problems = write_report([broken, four, tmp_path / "nowhere"], tmp_path / "page.html", bibtex=BIBTEX)
    page = (tmp_path / "page.html").read_text(encoding="utf-8")
    assert len(problems) == 2
    for name in (broken / "plan.toml", tmp_path / "nowhere"):
        assert any(str(name) in problem for problem in problems)
        assert str(name) in page
    assert len(data_of(page)) == 1
    with pytest.raises(RunFolderError, match="nowhere"):
        write_report([tmp_path / "nowhere"], tmp_path / "none.html", bibtex=BIBTEX)
    assert not (tmp_path / "none.html").exists()


@pytest.mark.parametrize("failure", [OverflowError("too large"), ValueError("NaN"), KeyError("hip_x")])
def test_whatever_is_wrong_with_a_folder_the_others_are_reported(four, tmp_path, monkeypatch, failure):
    bad = shutil.copytree(four, tmp_path / "bad")
    read = page_module.read_study

    def read_study(path, progress):
        if path == bad:
            raise failure
        return read(path, progress)

    monkeypatch.setattr(page_module, "read_study", read_study)
    (problem,) = write_report([bad, four], tmp_path / "page.html", bibtex=BIBTEX)
    assert str(bad) in problem
    assert type(failure).__name__ in problem
    assert len(data_of((tmp_path / "page.html").read_text(encoding="utf-8"))) == 1
    with pytest.raises(RunFolderError, match=type(failure).__name__):
        write_report([bad], tmp_path / "none.html", bibtex=BIBTEX)


def test_a_folder_with_numbers_that_are_none_is_named_and_the_others_are_reported(four, tmp_path):
    bad = shutil.copytree(four, tmp_path / "bad")
    file = bad / "survival.parquet"
    table = pq.read_table(file)
    endless = pa.array([math.inf] * len(table), table.schema.field("seconds_up").type)
    place = table.column_names.index("seconds_up")
    pq.write_table(table.set_column(place, table.schema.field("seconds_up"), endless), file)
    manifest = json.loads((bad / "manifest.json").read_text())
    manifest["files"]["survival.parquet"] = hash_of(file.read_bytes())
    (bad / "manifest.json").write_text(json.dumps(manifest))
    write_report([bad, four], tmp_path / "page.html", bibtex=BIBTEX)
    assert data_of((tmp_path / "page.html").read_text(encoding="utf-8"))


@pytest.mark.parametrize("name", ["trajectories", "evaluations", "survival", "episodes"])
def test_a_damaged_table_is_named_and_the_rest_is_reported(four, tmp_path, name):
    run = shutil.copytree(four, tmp_path / "run")
    (run / f"{name}.parquet").write_bytes(b"PAR1")
    page = page_of(run)
    (study,) = data_of(page)
    assert f"{name}.parquet" in re.findall(r'role="alert">(.*?)</div>', page, re.DOTALL)[0]
    assert bool(study["curves"]) == (name == "trajectories")
    assert any(lane["walk"] for lane in study["lanes"]) == (name != "trajectories")
    assert "The plan" in page


def test_a_study_under_way_is_reported_as_far_as_it_is(make_run, tmp_path):
    run = make_run(tmp_path / "run", num_seeds=3)
    manifest = json.loads((run / "manifest.json").read_text())
    (run / "manifest.json").write_text(json.dumps(manifest | {"status": "running", "files": {}}))
    for name in ("trajectories", "survival"):
        (run / f"{name}.parquet").unlink()
    path = run / "evaluations.parquet"
    table = pq.read_table(path)
    lanes, steps = np.array(table["lane"].to_pylist()), np.array(table["step"])
    begun = np.char.startswith(lanes, "sparse") | ((lanes == "forward-0") & (steps <= 10_000))
    pq.write_table(table.filter(begun & (steps <= 30_000)), path)
    page = page_of(run)
    (study,) = data_of(page)
    assert "under way: shown are 3 of 12 lanes up to step 30,000 of 60,000" in page
    assert {lane["setup"] for lane in study["lanes"]} == {"sparse"}
    assert study["curves"][1]["steps"] == [10_000, 20_000, 30_000]
    assert 'id="claims"' not in page
    pq.write_table(table.slice(0, 0), path)
    assert "no lane has been evaluated yet" in page_of(run)


def test_of_many_lanes_an_even_selection_walks_and_all_are_counted(make_run, tmp_path):
    run = make_run(tmp_path / "run", num_seeds=40, seconds=0.5)
    page = page_of(run)
    (study,) = data_of(page)
    assert len(study["lanes"]) == 160
    assert len(study["poses"]["starts"]) == 161
    embedded = [lane for lane in study["lanes"] if lane["walk"]]
    assert len(embedded) == 128
    assert "128 of 160 walks are in this page, 32 of each setup" in page
    for setup in study["setups"]:
        own = [lane for lane in study["lanes"] if lane["setup"] == setup]
        assert own[0]["walk"]
        assert own[-1]["walk"]


@pytest.mark.parametrize(("count", "most"), [(5, 9), (9, 9), (100, 32), (7, 1), (3, 0), (40, 2)])
def test_a_selection_is_even_and_has_both_ends(count, most):
    chosen = even_selection(count, most)
    assert len(chosen) == min(count, most)
    assert chosen == sorted(set(chosen))
    if len(chosen) > 1:
        assert (chosen[0], chosen[-1]) == (0, count - 1)
        assert np.ptp(np.diff(chosen)) <= 1


def test_other_formats_hold_the_same_tables(several, tmp_path):
    (path,), problems = write(several, tmp_path / "r.md", "md", bibtex=BIBTEX, progress=quiet)
    text = path.read_text(encoding="utf-8")
    page = page_of(*several)
    assert not problems
    for row in cells(page, "Highest walking distance [m]"):
        assert "| " + " | ".join(row) + " |" in text
    paths, _ = write(several, tmp_path / "figures", "pdf-figures", bibtex=BIBTEX, progress=quiet)
    assert {path.name for path in paths} == {"learning_curves.pdf", "walking_distance.pdf", "claims.pdf"}
    assert len(paths) == 6
    for path in paths:
        assert path.read_bytes().startswith(b"%PDF")
        (width,) = re.findall(rb"/MediaBox \[ ?0 0 ([\d.]+) ", path.read_bytes())
        assert float(width) == pytest.approx(7.16 * 72, abs=1)


def test_without_a_name_it_lies_in_the_run_folder(four, tmp_path, monkeypatch):
    run = shutil.copytree(four, tmp_path / "run")
    assert write([run], None, "html", bibtex=BIBTEX, progress=quiet)[0] == [run / "report.html"]
    monkeypatch.chdir(tmp_path)
    assert [str(path) for path in write([run, run], None, "md", bibtex=BIBTEX, progress=quiet)[0]] == [
        "report.md"
    ]


HOP = RESULTS / "walker2d" / "hop"


@pytest.fixture(scope="module")
def of_robot():
    return page_of(HOP)


def test_the_numbers_of_a_robot_are_those_of_the_parquet_file(of_robot):
    evaluations = pq.read_table(HOP / "evaluations.parquet").to_pandas()
    last = evaluations[evaluations.step == evaluations.step.max()]
    header, *rows = cells(of_robot, "Last evaluation, seed by seed")
    assert len(rows) == 3
    for lane, *values in rows:
        own = last[last.lane == lane]
        assert float(values[header.index("distance [m]") - 1]) == pytest.approx(own.distance.mean(), rel=5e-3)
        assert float(values[header.index("falls [%]") - 1]) == pytest.approx(100 * own.fell.mean(), rel=5e-3)
    ((_, *names), (_, mean, *_)) = cells(of_robot, "Last evaluation")
    assert names[0] == "environment's return"
    assert f"{last.environment.mean():,.0f} [" in mean


def test_a_robots_curves_are_those_of_the_parquet_file(of_robot, in_node):
    evaluations = pq.read_table(HOP / "evaluations.parquet").to_pandas()
    (study,) = data_of(of_robot)
    assert [curve["key"] for curve in study["curves"]] == [
        *("environment", "behaviour", "cycle", "fell", "length", "distance", "trained")
    ]
    lengths = next(curve for curve in study["curves"] if curve["key"] == "length")
    back = in_node("unpack(input).then((c) => Array.from(c.value))", lengths["setups"][0]["band"])
    means = evaluations[evaluations.step <= 1_000_000].groupby("step").length.mean()
    assert lengths["steps"] == means.index.tolist()
    np.testing.assert_allclose(back, means, atol=0.05)


def test_of_a_robot_without_a_plant_the_page_says_what_it_lacks(of_robot):
    for part in ('id="walkers"', 'id="seeds"', 'id="claims"', "virtual gravity controller"):
        assert part not in of_robot
    assert "Walker2d-v5 is a Gymnasium environment" in of_robot
    assert "coachable watch runs/hop --setup both --seed 0 -o gait.gif" in of_robot
    assert "behaviour &#34;hopping&#34;" in of_robot
    assert of_robot.count('<svg xmlns="http://www.w3.org/2000/svg"') == 1
    assert cells(of_robot, "Gaits")[0] == ["", "both"]
    assert ["gae_lambda", "0.95"] in cells(of_robot, "Learner")
    assert cells(of_robot, "Setups")[1][:3] == ["both", "1", "no"]


def test_a_plant_and_a_robot_stand_in_one_page(four, of_robot):
    page = page_of(four, HOP)
    plant, robot = data_of(page)
    assert plant == data_of(page_of(four))[0]
    assert robot == data_of(of_robot)[0]
    assert 'id="walkers"' in page
    assert 'data-study="0"' in page
    assert 'data-study="1"' not in page


def test_a_damaged_gait_table_is_named_and_the_rest_is_reported(tmp_path):
    run = shutil.copytree(HOP, tmp_path / "run")
    (run / "gaits.parquet").write_bytes(b"PAR1")
    page = page_of(run)
    assert "gaits.parquet" in re.findall(r'role="alert">(.*?)</div>', page, re.DOTALL)[0]
    assert len(cells(page, "Last evaluation")) == 2


def test_other_formats_of_a_robot_hold_the_same(of_robot, tmp_path):
    (path,), _ = write([HOP], tmp_path / "r.md", "md", bibtex=BIBTEX, progress=quiet)
    text = path.read_text(encoding="utf-8")
    for title in ("Last evaluation", "Last evaluation, seed by seed", "Learner"):
        for row in cells(of_robot, title):
            assert "| " + " | ".join(row) + " |" in text
    (figure,), _ = write([HOP], tmp_path / "figures", "pdf-figures", bibtex=BIBTEX, progress=quiet)
    assert figure.name == "learning_curves.pdf"
    assert figure.read_bytes().startswith(b"%PDF")
