from coachable.analysis.gait_table import print_table


def test_names_in_brackets_are_no_markup(tmp_path, capsys):
    print_table("study: hop [both], 1 [/seed]", ["setup"], [["a [b]"]], "Note.", tmp_path / "table.md")
    printed = capsys.readouterr().out
    assert "study: hop [both], 1 [/seed]" in printed
    assert "a [b]" in printed
