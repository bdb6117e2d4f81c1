import pytest

from coachable.foundation.errors import CoachableError
from coachable.viewing.watch import draw_motions


@pytest.mark.parametrize(
    ("name", "begins"), [("gait.png", b"\x89PNG"), ("gait.gif", b"GIF"), ("gait.pdf", b"%PDF")]
)
def test_a_file_is_what_its_name_says(until, phases, tmp_path, name, begins):
    path = tmp_path / name
    draw_motions({"one": until(0.2), "two": until(0.3)}, path, phases)
    assert path.read_bytes().startswith(begins)


def test_another_file_is_refused_and_nothing_written(until, phases, tmp_path):
    with pytest.raises(CoachableError, match=r"\.gif, \.mp4, \.png"):
        draw_motions({"": until(0.1)}, tmp_path / "gait.doc", phases)
    assert not list(tmp_path.iterdir())
