import re

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from coachable.behaviours.library import LIBRARY
from coachable.behaviours.text.document import formatted_file, read_document
from coachable.behaviours.text.formatter import WIDTH, formatted
from coachable.behaviours.text.parser import parse

UGLY = """\


# A comment on all of it.
behaviour   "hop"   # in one line
    Up   and

    down.

signals
      height[m]above the ground; a long description is wrapped where the line ends, and stays below it
      # the other one
      speed=d/dt height   [m/s]

constants
  still = 0.1[m/s]
# the words
vocabulary


  it rises means speed>still  # faster


  it is high means height>( 1+2 )*-still and not(it rises)
phases
  up "going up": it rises,# first
    # between
    it is high   # last
  down: not it rises
edges
  up->down
outside   "sleep"


"""

PRETTY = """\
# A comment on all of it.
behaviour "hop"  # in one line
  Up and

  down.

signals
  height               [m]    above the ground; a long description is wrapped where the line ends,
                              and stays below it
  # the other one
  speed = d/dt height  [m/s]

constants
  still  = 0.1 [m/s]

# the words
vocabulary
  it rises    means  speed > still  # faster

  it is high  means  height > (1 + 2) * -still and not (it rises)

phases
  # first
  # between
  up     "going up":  it rises, it is high  # last
  down:               not it rises

edges
  up -> down

outside "sleep"
"""


def test_the_formatter_lays_out_and_keeps_comments():
    assert formatted(UGLY) == PRETTY


TEXTS = [UGLY, *(path.read_text(encoding="utf-8") for path in sorted(LIBRARY.iterdir()))]


def spoilt(text, random):
    """The same text in another layout, with more comments."""
    lines = []
    for line in text.split("\n"):
        if random.random() < 0.2 and not lines:
            lines.append("# on top")
        line = (
            re.sub(r"(?<=[^ ]) (?=[^ ])", lambda _: " " * random.randint(1, 3), line)
            if '"' not in line
            else line
        )
        if line and random.random() < 0.2:
            line += " # said"
        if line.startswith("  "):
            line = "  " + line
        lines.append(line)
        if random.random() < 0.1 and not any("behaviour" in before for before in lines[-4:]):
            lines.append("  # below")
    return "\n".join(lines)


@settings(max_examples=60)
@given(st.sampled_from(TEXTS), st.randoms(use_true_random=False))
def test_formatting_twice_is_once_and_loses_nothing(text, random):
    text = spoilt(text, random)
    once = formatted(text)
    assert formatted(once) == once
    assert sorted(re.findall(r"#.*", once)) == sorted(re.findall(r"#.*", text))
    code = [re.sub(r"#.*", "", each).split() for each in (text, once)]
    assert "".join(code[0]).replace(" ", "") == "".join(code[1]).replace(" ", "")
    assert all(len(line) <= WIDTH for line in once.split("\n") if "#" not in line and "->" not in line)
    if "include" not in text and "behaviour" in text:
        assert parse(once) == parse(text)


def test_a_document_knows_its_lines(tmp_path):
    path = tmp_path / "gait.behaviour"
    path.write_text((LIBRARY / "perry-gait.behaviour").read_text(encoding="utf-8"), encoding="utf-8")
    (tmp_path / "planar-walker.vocabulary").write_text((LIBRARY / "planar-walker.vocabulary").read_text())
    document = read_document(path)
    lines = path.read_text(encoding="utf-8").splitlines()

    def said(kind, name):
        line = document.line_of(kind, name)
        return None if line is None else lines[line - 1]

    assert document.text == path.read_text(encoding="utf-8")
    assert (
        said("signal", "left_foot_x")
        == said("phrase", "left foot is up")
        == 'include "planar-walker.vocabulary"'
    )
    for side in ("left", "right"):
        assert "left leg swings  " in str(said("phrase", f"{side} leg swings"))
        assert "left_mid_swing " in str(said("phase", f"{side}_mid_swing"))
    edges = [str(edge) for edge in document.behaviour.edges]
    assert {said("edge", edge) for edge in edges} == {said("cycle", "0")}
    assert "left_pre_swing ->" in str(said("cycle", "0"))
    assert said("phase", "nowhere") is None


def test_what_has_mistakes_is_not_formatted(tmp_path):
    path = tmp_path / "hop.behaviour"
    path.write_text(UGLY.replace("it is high   #", "it is hihg   #"))
    with pytest.raises(Exception, match="did you mean 'it is high'"):
        formatted_file(path)
