from coachable.analysis.sections import Section
from coachable.analysis.table import console, rendered


def test_names_in_brackets_are_no_markup(capsys):
    section = Section("study: hop [both], 1 [/seed]", ("setup",), (("a [b]",),), ("Note [c].",))
    console().print(*rendered(section), sep="\n")
    printed = capsys.readouterr().out
    assert "study: hop [both], 1 [/seed]" in printed
    assert "a [b]" in printed
    assert "Note [c]." in printed
