"""What several commands refuse before they begin."""

import pytest

from coachable.cli.options import require_no_input
from coachable.foundation.errors import CoachableError


def test_an_output_is_no_input(tmp_path):
    run, trace = tmp_path / "run", tmp_path / "trace.csv"
    for folder in (run, run / "policies"):
        folder.mkdir()
    for file in (trace, run / "manifest.json", run / "plan.toml"):
        file.write_text("")
    (tmp_path / "same.csv").symlink_to(trace)
    for out in (
        trace,
        tmp_path / "same.csv",
        tmp_path / "run" / ".." / "trace.csv",
        run / "plan.toml",
        run / "gaits.parquet",
        run / "policies" / "walk.csv",
    ):
        with pytest.raises(CoachableError, match="give another file"):
            require_no_input(out, trace, run)
    for out in (None, run / "report.html", tmp_path / "phases.csv", tmp_path / "plan.toml"):
        require_no_input(out, trace, run)
