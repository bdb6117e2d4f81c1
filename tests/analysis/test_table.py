import io
import math

import pytest
from rich.console import Console

from coachable.analysis.intervals import Estimate
from coachable.analysis.measurements import measure_tables
from coachable.analysis.sections import NOTHING, number, p_value, percent, sections, steps, with_interval
from coachable.analysis.table import markdown, print_table, table, write_markdown

pytestmark = pytest.mark.usefixtures("quick")


@pytest.mark.parametrize(
    ("function", "value", "expected"),
    [
        (number, 8.045, "8.04"),  # the double nearest to 8.045 lies below it
        (number, 8.0451, "8.05"),
        (number, -0.004, "0.00"),
        (number, -1.5, "−1.50"),
        (number, math.nan, NOTHING),
        (steps, 268_400.0, "268k"),
        (steps, math.inf, "never"),
        (steps, math.nan, NOTHING),
        (percent, 0.995, "100"),
        (percent, math.nan, NOTHING),
        (p_value, 0.0004, "<0.001"),
        (p_value, 0.001, "0.001"),
        (p_value, 1.0, "1.000"),
        (p_value, math.nan, NOTHING),
        (with_interval, Estimate(8.6, 8.41, 8.724), "8.60 [8.41, 8.72]"),
        (with_interval, Estimate(8.6), "8.60"),
    ],
)
def test_rounding(function, value, expected):
    assert function(value) == expected


def test_both_ends_of_an_interval_are_written_as_the_value_is():
    assert with_interval(Estimate(268e3, 240_499.0, 301e3), steps) == "268k [240k, 301k]"


def lines_of(runs, width=100):
    page = io.StringIO()
    Console(file=page, width=width).print(*table(runs), sep="\n")
    return page.getvalue().splitlines()


@pytest.fixture(scope="module")
def said(small_study, quick):
    return sections(small_study)


def cells(said, title, row):
    (section,) = (section for section in said if section.title.startswith(title))
    (found,) = (cells for cells in section.rows if cells[0] == row)
    return dict(zip(section.header, found, strict=True))


def test_it_is_readable_in_a_hundred_columns(small_study, said):
    lines = lines_of(small_study)
    assert max(map(len, lines)) <= 100
    for section in said:
        for row in section.rows:
            assert any(all(cell in line for cell in row) for line in lines), row  # no cell is wrapped


def test_ours_stand_beside_the_paper_s(small_study, said):
    assert cells(said, "Highest", "orthant")["paper"] == "8.83"
    assert cells(said, "Highest", "orthant")["best run"] == number(small_study["orthant"].highest.max())
    assert cells(said, "Highest", "virtual gravity") == {
        "setup": "virtual gravity",
        "best run": "7.80",
        "paper": "8.32",
        "mean": "",
        "interquartile mean": "",
        "mean, no falls": "",
    }
    assert cells(said, "Learning", "sparse")["paper"] == "0.814"
    assert cells(said, "Final walkers", "sparse")["up at 10 s"] == "4 of 4"


def test_a_study_of_other_setups_has_no_columns_of_the_paper_and_no_claims(tables):
    runs = measure_tables(*tables(("mine", "yours")))
    said = sections(runs)
    assert not any("paper" in section.header for section in said)
    assert not any("laims" in section.title for section in said)


def test_a_setup_of_one_s_own_beside_the_paper_s_has_dashes(tables):
    runs = measure_tables(*tables(("sparse", "mine")))
    assert cells(sections(runs), "Highest", "mine")["paper"] == NOTHING


def test_one_seed_without_survival_still_makes_a_table(tables):
    runs = measure_tables(*tables(num_seeds=1, survival=False))
    said = sections(runs)
    assert cells(said, "Final walkers", "sparse")["up at 100 s"] == NOTHING
    assert cells(said, "Standard deviations between runs, of final", "sparse")["distance [m]"] == NOTHING
    assert "nan" not in "\n".join(lines_of(runs))


def test_the_semantics_say_which_distance_it_is(tables, small_study):
    released = measure_tables(*tables(semantics="released-code"))
    assert any("Distance is the stance foot's" in line for line in lines_of(released))
    assert any("Distance is the hip's" in line for line in lines_of(small_study))


def test_markdown_has_every_cell(small_study, said, tmp_path):
    text = markdown(small_study)
    for section in said:
        assert f"## {section.title}\n" in text
        for row in section.rows:
            assert "| " + " | ".join(row) + " |" in text
    assert write_markdown(small_study, tmp_path).read_text(encoding="utf-8") == text


def test_into_a_pipe_it_is_printed_a_hundred_columns_wide(small_study, capsys, monkeypatch):
    monkeypatch.setenv("COLUMNS", "60")
    print_table(small_study)
    assert capsys.readouterr().out.splitlines() == lines_of(small_study)
