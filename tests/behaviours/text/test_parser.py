import dataclasses

import pytest

from coachable.behaviours import (
    All,
    Any,
    Between,
    Comparison,
    Dwell,
    Edge,
    Near,
    Not,
    Number,
    Phrase,
    Variable,
)
from coachable.behaviours.expressions import Arithmetic, Call, Negative
from coachable.behaviours.text.parser import parse
from coachable.behaviours.text.printer import to_text
from coachable.foundation.errors import BehaviourTextError

HOP = """\
behaviour "hop"
  Up and down,
  and up again.

signals
  height               [m]   above the ground
  speed = d/dt height  [m/s]
  load

constants
  touch = 20 [N]   what counts
  still = -1e-3

vocabulary
  feet carry means load > touch deadband 5 [N]
  feet hang  means not feet carry

phases
  ground "on the ground" for at most 0.5 s: feet carry,
    speed <= 0
  "in the air" for 0.1 s to 2 s: feet hang
  push: feet carry and speed > 0

cycle
  ground -> push -> "in the air" -> ground on landing with speed := -speed

edges
  push -> ground
  push -> ground on "a fall"

outside "sitting"
"""


def test_a_text_says_what_it_says():
    hop = parse(HOP)
    assert hop.name == "hop"
    assert hop.description == "Up and down,\nand up again."
    assert [(s.name, s.unit, s.description, s.derivative_of) for s in hop.signals] == [
        ("height", "m", "above the ground", None),
        ("speed", "m/s", "", "height"),
        ("load", "", "", None),
    ]
    touch, still = hop.constants
    assert (touch.number, touch.description, still.number) == (Number(20, "N"), "what counts", Number(-0.001))
    carry = Phrase("feet carry", Comparison("load", ">", touch, Number(5, "N")))
    hang = Phrase("feet hang", Not(carry))
    assert hop.vocabulary == (carry, hang)
    ground, air, push = hop.phases
    assert (ground.title, ground.dwell) == ("on the ground", Dwell(at_most=0.5))
    assert ground.predicate == All(carry, Comparison("speed", "<=", 0))
    assert (air.name, air.predicate, air.dwell) == ("in the air", hang, Dwell(0.1, 2))
    assert push.predicate == All(carry, Comparison("speed", ">", 0))
    assert [str(edge) for edge in hop.edges] == [
        "ground → push",
        "push → in the air",
        "in the air → ground on landing",
        "push → ground",
        "push → ground on a fall",
    ]
    assert str(hop.edges[2].reset[0]) == "speed := -speed"
    assert hop.cycles == (hop.edges[:3],)
    assert hop.outside == "sitting"


X, Y, Z = Variable("x"), Variable("y"), Variable("z")


@pytest.mark.parametrize(
    ("text", "predicate"),
    [
        ("x > 0", Comparison("x", ">", 0)),
        ("-x >= -0.5 [rad]", Comparison(Negative(X), ">=", Number(-0.5, "rad"))),
        ("0.1 < x <= 3e-1", Between(0.1, "<", "x", "<=", 0.3)),
        ("x = y within 0.1", Near("x", "y", 0.1)),
        ("x - y - z > 0", Comparison(Arithmetic(Arithmetic(X, "-", Y), "-", Z), ">", 0)),
        ("x - (y - z) > 0", Comparison(Arithmetic(X, "-", Arithmetic(Y, "-", Z)), ">", 0)),
        ("x + y * -z > 0", Comparison(Arithmetic(X, "+", Arithmetic(Y, "*", Negative(Z))), ">", 0)),
        ("(x + y) / z > 0", Comparison(Arithmetic(Arithmetic(X, "+", Y), "/", Z), ">", 0)),
        ("min(x, y, 3) < sin(x)", Comparison(Call("min", X, Y, Number(3)), "<", Call("sin", X))),
        ("-(0.5) < x", Comparison(Negative(Number(0.5)), "<", "x")),
        (
            "(x > 0) or not (y > 0 and true)",
            Any(Comparison("x", ">", 0), Not(All(Comparison("y", ">", 0), All()))),
        ),
        (
            "(x > 0 or y > 0), z > 0",
            All(Any(Comparison("x", ">", 0), Comparison("y", ">", 0)), Comparison("z", ">", 0)),
        ),
        ("false", Any()),
    ],
)
def test_predicates_are_read_as_in_arithmetic(text, predicate):
    text = f'behaviour ""\nsignals\n  x\n  y\n  z\nphases\n  p: {text}'
    assert parse(text).phases[0].predicate == predicate


BEGIN = """\
behaviour "b"
signals
  x [m]
  speed = d/dt x [m/s]
vocabulary
  far out means x > 1
phases
  A: far out
"""

MISTAKES = {
    "nothing": ("", ["line 1, column 1: this text has no name", "there are no phases"]),
    "a misspelt section": (
        BEGIN + "cycles\n",
        ["line 9, column 1: no section is called 'cycles'", "'cycle'"],
    ),
    "a misspelt phrase": (
        BEGIN + "  B: not far oot\n",
        [
            "line 9, column 10: 'far oot' is not in the vocabulary\n      B: not far oot\n             ^",
            "did you mean 'far out'?",
        ],
    ),
    "a misspelt signal": (BEGIN + "  B: spede > 1\n", ["line 9, column 6: 'spede' is neither", "'speed'"]),
    "a misspelt phase": (
        BEGIN + "  AB: x > 0\nedges\n  A -> BA\n",
        ["line 11, column 8: no phase is called 'BA'", "did you mean 'A'"],
    ),
    "a misspelt derivative": (BEGIN + "signals\n  a = d/dt xx\n", ["line 10, column 12: xx is not a signal"]),
    "a phrase as a number": (BEGIN + "  B: far out > 1\n", ["a phrase is a condition; it has no value"]),
    "a comparison left out": (
        BEGIN + "  B: x 1\n",
        ["line 9, column 8: '1'", "a comparison such as > or <="],
    ),
    "a number as a predicate": (BEGIN + "  B: x + 1\n", ["this is a number; compare it", "x > 0"]),
    "a signal as a predicate": (BEGIN + "  B: not x\n", ["x is a number; compare it"]),
    "a predicate as a number": (
        BEGIN + "  B: (x > 1) + 1 > 0\n",
        ["a condition has no value to calculate with"],
    ),
    "equality": (BEGIN + "  B: x = 3\n", ["line 9, column 11", "within", "equality needs a tolerance"]),
    "another equality": (BEGIN + "  B: x == 3\n", ["line 9, column 9", "equality needs a tolerance"]),
    "a letter for a comparison": (BEGIN + "  B: x ≥ 3\n", ["line 9, column 8: '≥'", "are written <, <=, >"]),
    "a falling range": (BEGIN + "  B: 3 > x > 1\n", ["a range goes from low to high"]),
    "and beside or": (
        BEGIN + "  B: x > 1 and x < 3 or x > 5\n",
        ["line 9, column 22: 'or'", "(a and b) or c"],
    ),
    "a unit without brackets": (BEGIN + "  B: x > 5 deg\n", ["a unit is written in brackets: [deg]"]),
    "a minus without spaces": (
        BEGIN + "  B: x-speed > 1\n",
        ["no signal is called 'x-speed'", "write x - speed"],
    ),
    "an unknown function": (BEGIN + "  B: tan(x) > 1\n", ["unknown function 'tan'"]),
    "too many arguments": (BEGIN + "  B: sin(x, x) > 1\n", ["sin takes one argument"]),
    "too large a number": (BEGIN + "  B: x > 1e999\n", ["line 9, column 10: inf is not a finite number"]),
    "a phrase in a circle": (
        BEGIN + "vocabulary\n  a b means c\n  c means a b\n",
        ["defined by itself: a b → c → a b"],
    ),
    "a reserved word": (BEGIN + "constants\n  true = 1\n", ["'true' is a word of the language"]),
    "a signal twice": (BEGIN + "signals\n  x\n", ["line 10, column 3: x is given twice; first in line 3"]),
    "a phase twice": (BEGIN + "  A: x > 2\n", ["phase A is given twice; first in line 8"]),
    "a phrase twice": (
        BEGIN + "vocabulary\n  far out means x > 2\n",
        ["'far out' is given twice; first in line 6"],
    ),
    "an edge twice": (BEGIN + "edges\n  A -> A\n  A -> A\n", ["edge A → A is given twice; first in line 10"]),
    "an open cycle": (
        BEGIN + "  B: x > 3\ncycle\n  A -> B\n",
        ["begins in A and ends in B", "must end in A"],
    ),
    "a chain of edges": (
        BEGIN + "edges\n  A -> A -> A\n",
        ["line 10, column 13: edges has one edge a line", "cycle"],
    ),
    "another arrow": (BEGIN + "cycle\n  A → A\n", ["line 10, column 5: '→'", "written ->"]),
    "two values": (BEGIN + "edges\n  A -> A with x := 1, x := 2\n", ["x gets two values"]),
    "a value for nothing": (BEGIN + "edges\n  A -> A with y := x\n", ["y is not a signal"]),
    "a dwell without seconds": (BEGIN + "  B for 3: x > 1\n", ["line 9, column 10: ':'", "s, for seconds"]),
    "a description in another place": (BEGIN + "  hello there\n", ["line 9, column 9: 'there'"]),
    "an item nowhere": ("  hello\n" + BEGIN, ["line 1, column 3: this line is in no section"]),
    "an uneven indent": (BEGIN + " B: x > 1\n", ["line 9, column 2: this line is indented by 1"]),
    "an odd escape": (BEGIN + '  B "\\q": x > 1\n', ["line 9, column 5", "an unknown escape"]),
    "an open quote": (
        BEGIN + '  B "a: x > 1\n',
        ["line 9, column 5: '\"' is not expected", "ends in the line"],
    ),
    "a header with more": (BEGIN.replace("phases", "phases now"), ["phases must be alone in its line"]),
    "two names": (BEGIN + 'behaviour "again"\n', ["behaviour is given twice; first in line 1"]),
    "a mirror in a mirror": (BEGIN + "mirror a <-> b, b <-> c\n", ["b is swapped twice"]),
    "an include out of nowhere": (BEGIN + 'include "x"\n', ["this text is in no folder"]),
    "NUL": (BEGIN + "  B: x > \0\n", ["line 9, column 10: an invisible character: U+0000"]),
    "a bidirectional trick": (
        BEGIN + "# \u202e\n",
        ["line 9, column 3: an invisible character: U+202E"],
    ),
    "a lone surrogate": (BEGIN + "  B: \ud800 > 1\n", ["line 9, column 6", "U+D800"]),
    "a no-break space": (BEGIN + "  B: far\u00a0out\n", ["line 9, column 9", "NO-BREAK SPACE"]),
    "a letter in disguise": (
        BEGIN + "signals\n  sp\u0435\u0435d\n",
        ["line 10, column 3", "U+0435 CYRILLIC SMALL LETTER IE", "mixes letters"],
    ),
    "a name in disguise": (BEGIN + "  B: \u0445 > 1\n", ["U+0445 CYRILLIC SMALL LETTER HA"]),
    "a ligature": (BEGIN + "signals\n  \ufb01x\n", ["write 'fix'"]),
    "deep parentheses": (BEGIN + f"  B: {'(' * 40}x > 1{')' * 40}\n", ["nested 40 deep"]),
    "a long sum": (BEGIN + f"  B: {'x + ' * 90}x > 1\n", ["no more than 60 terms"]),
    "a long line": (BEGIN + f"  B: {'x + ' * 900}x > 1\n", ["the line has", "no more than 1000"]),
    "many lines": (BEGIN + "\n" * 6000, ["lines; no more than 5000"]),
    "much text": (BEGIN + ("# " + "x" * 90 + "\n") * 4000, ["bytes; no more than 262144"]),
    "a bomb": (
        BEGIN
        + "vocabulary\n  w0 means x > 1\n"
        + "".join(f"  w{n} means w{n - 1} and w{n - 1}\n" for n in range(1, 40)),
        ["parts", "no more than 5000"],
    ),
    "a tower": (
        BEGIN
        + "vocabulary\n  w0 means x > 1\n"
        + "".join(f"  w{n} means not w{n - 1}\n" for n in range(1, 400)),
        ["deep", "60"],
    ),
    "a falling tower": (
        BEGIN
        + "vocabulary\n"
        + "".join(f"  w{n} means not w{n + 1}\n" for n in range(400))
        + "  w400 means x > 1\n",
        ["deep", "60"],
    ),
}


@pytest.mark.parametrize("case", MISTAKES)
def test_a_mistake_is_told_with_its_place_and_what_to_do(case):
    text, told = MISTAKES[case]
    with pytest.raises(BehaviourTextError) as caught:
        parse(text)
    for words in told:
        assert words in str(caught.value)
    assert all(letter.isprintable() for letter in str(caught.value).replace("\n", ""))


def test_all_mistakes_are_told_in_their_order_and_none_twice():
    text = (
        BEGIN.replace("x > 1", "x >") + "  B: far out, x > 0\n  C: fur out\ncycle\n  A -> D\n  A -> B -> A\n"
    )
    with pytest.raises(BehaviourTextError) as caught:
        parse(text)
    places = [line.partition(": ")[0] for line in str(caught.value).splitlines() if line.startswith("line")]
    assert places == ["line 6, column 20", "line 10, column 6", "line 12, column 8"]


def test_what_is_only_layout_changes_nothing():
    plain = parse(HOP)
    for text in (
        "\ufeff" + HOP,
        HOP.replace("\n", "\r\n"),
        HOP.replace("  ", "\t"),
        HOP.replace("\n\n", "\n# a comment\n"),
        HOP.replace("feet carry,\n", "feet carry,  # goes on\n\n      # here\n\n"),
    ):
        assert parse(text) == plain


STEP = """\
behaviour "steps"
signals
  left_foot [m]
  right_foot [m]
constants
  left_reach = 1 [m]  of the left leg
mirror left <-> right
vocabulary
  left leg reaches means left_foot > left_reach
  nobody reaches means not left leg reaches and not right leg reaches
phases
  left_step "Left leg forward" for at most 2 s: left leg reaches, left_foot > right_foot
  left_rest: nobody reaches, left_foot > right_foot
cycle
  left_step -> left_rest -> right_step on left_touch with left_foot := right_foot
edges
  left_rest -> left_step
"""


def test_who_writes_one_step_gets_the_other():
    steps = parse(STEP)
    assert [constant.name for constant in steps.constants] == ["left_reach", "right_reach"]
    assert steps.constants[1].description == "of the right leg"
    assert [str(phrase) for phrase in steps.vocabulary] == [
        "left leg reaches",
        "nobody reaches",
        "right leg reaches",
    ]
    assert [(phase.name, phase.title) for phase in steps.phases] == [
        ("left_step", "Left leg forward"),
        ("left_rest", ""),
        ("right_step", "Right leg forward"),
        ("right_rest", ""),
    ]
    assert steps.phases[2].dwell == steps.phases[0].dwell
    assert str(steps.phases[2].predicate) == "right leg reaches and right_foot > left_foot"
    assert [str(edge) for edge in steps.edges] == [
        "left_step → left_rest",
        "left_rest → right_step on left_touch",
        "right_step → right_rest",
        "right_rest → left_step on right_touch",
        "left_rest → left_step",
        "right_rest → right_step",
    ]
    assert str(steps.edges[3].reset[0]) == "right_foot := left_foot"
    assert steps.cycles == (steps.edges[:4],)


def test_the_mirror_image_of_a_text_says_the_same():
    swapped = (
        STEP.replace("left", "l").replace("right", "left").replace("l_", "right_").replace(" l ", " right ")
    )
    swapped = swapped.replace("mirror right <-> left", "mirror left <-> right").replace("Left", "Right")
    one, other = parse(STEP), parse(swapped)
    assert {phase.name: str(phase.predicate) for phase in one.phases} == {
        phase.name: str(phase.predicate) for phase in other.phases
    }
    assert set(one.edges) == set(other.edges)


def test_a_cycle_that_closes_by_itself_has_an_image():
    steps = parse(STEP.replace("right_step on left_touch with left_foot := right_foot", "left_step"))
    left, right = steps.cycles
    assert [edge.source for edge in left] == ["left_step", "left_rest"]
    assert right == tuple(
        Edge(edge.source.replace("left", "right"), edge.target.replace("left", "right")) for edge in left
    )


@pytest.mark.parametrize(
    ("change", "told"),
    [
        (("  right_foot [m]\n", ""), "signal left_foot has no mirror image"),
        (("left_rest", "rest"), "phase rest differs from its mirror image"),
        (
            ("nobody reaches means not left leg reaches and", "nobody reaches means"),
            "phrase 'nobody reaches' differs",
        ),
        (("right_step on left_touch", "right_rest on left_touch"), "it must end in left_step or right_step"),
    ],
)
def test_a_mirror_that_does_not_fit_is_told(change, told):
    with pytest.raises(BehaviourTextError, match=told):
        parse(STEP.replace(*change))


FRAGMENT = "signals\n  x [m]\nvocabulary\n  far out means x > 1\n"
INCLUDING = 'behaviour "b"\ninclude "robot.vocabulary"\nphases\n  A: far out\n'


def test_an_included_file_gives_its_names(tmp_path):
    (tmp_path / "robot.vocabulary").write_text(FRAGMENT)
    assert parse(INCLUDING, tmp_path) == parse(f'behaviour "b"\n{FRAGMENT}phases\n  A: far out\n')


def test_files_that_include_one_another_are_read_once(tmp_path):
    (tmp_path / "robot.vocabulary").write_text('include "x.vocabulary"\ninclude "y.vocabulary"\n')
    (tmp_path / "x.vocabulary").write_text(FRAGMENT)
    (tmp_path / "y.vocabulary").write_text('include "x.vocabulary"\nconstants\n  near = 1\n')
    assert [c.name for c in parse(INCLUDING + "  B: x < near\n", tmp_path).constants] == ["near"]


def test_of_an_included_file_only_what_is_used_is_taken(tmp_path):
    rich = """
signals
  x [m]
  speed = d/dt x [m/s]
  y [m]
  z [m]
constants
  far = 1 [m]
  away = 2 [m]
vocabulary
  far out     means  x > far
  going       means  speed > 0
  gone        means  going and far out
  high        means  y > away
"""
    (tmp_path / "robot.vocabulary").write_text(rich)
    used = parse('behaviour "b"\ninclude "robot.vocabulary"\nphases\n  A: gone\n', tmp_path)
    assert used.signal_names == ("x", "speed")
    assert [constant.name for constant in used.constants] == ["far"]
    assert [phrase.words for phrase in used.vocabulary] == ["far out", "going", "gone"]
    only_speed = parse('behaviour "b"\ninclude "robot.vocabulary"\nphases\n  A: going\n', tmp_path)
    assert only_speed.signal_names == ("x", "speed"), "what it is the derivative of stays"
    own = f'behaviour "b"\n{rich}phases\n  A: gone\n'
    assert parse(own).signal_names == ("x", "speed", "y", "z"), "what a text itself declares stays"


@pytest.mark.parametrize(
    ("name", "told"),
    [
        ("../robot.vocabulary", "without folders"),
        ("/etc/passwd", "without folders"),
        ("folder/robot.vocabulary", "without folders"),
        ("..", "without folders"),
        ("", "without folders"),
        ("C:robot", "without folders"),
        ("nothing.vocabulary", "there is no file"),
        ("folder", "is not a file"),
        ("leads-out.vocabulary", "leads to another folder"),
        ("round.vocabulary", "there is no file"),
        ("itself.vocabulary", "'itself.vocabulary' includes itself"),
        ("many-0.vocabulary", "no more than 16 files"),
        ("whole.vocabulary", "phases is not allowed in an included file"),
        ("binary.vocabulary", r"binary\.vocabulary:1:2: .* not UTF-8"),
        ("large.vocabulary", "more than 262144 bytes"),
        ("mistaken.vocabulary", r"mistaken\.vocabulary:2:5: "),
    ],
)
def test_only_files_beside_are_included(tmp_path, name, told):
    here = tmp_path / "here"
    (here / "folder").mkdir(parents=True)
    (tmp_path / "secret.vocabulary").write_text(FRAGMENT)
    (here / "folder" / "robot.vocabulary").write_text(FRAGMENT)
    (here / "leads-out.vocabulary").symlink_to(tmp_path / "secret.vocabulary")
    (here / "round.vocabulary").symlink_to(here / "round.vocabulary")
    (here / "itself.vocabulary").write_text('include "itself.vocabulary"\n')
    for number in range(20):
        (here / f"many-{number}.vocabulary").write_text(f'include "many-{number + 1}.vocabulary"\n')
    (here / "whole.vocabulary").write_text(BEGIN)
    (here / "binary.vocabulary").write_bytes(b"#\xff")
    (here / "large.vocabulary").write_text(" " * 300_000)
    (here / "mistaken.vocabulary").write_text("signals\n  x %\n")
    with pytest.raises(BehaviourTextError, match=told):
        parse(INCLUDING.replace("robot.vocabulary", name), here)


def test_what_ships_can_be_included_from_anywhere_but_a_file_beside_comes_first(tmp_path):
    text = INCLUDING.replace("robot.vocabulary", "planar-walker.vocabulary")
    assert "left_foot_x" in parse(text.replace("far out", "left foot is ahead"), tmp_path).signal_names
    (tmp_path / "planar-walker.vocabulary").write_text(FRAGMENT)
    assert parse(text, tmp_path).signal_names == ("x",)


def test_a_name_that_a_text_includes_is_not_declared_again(tmp_path):
    (tmp_path / "robot.vocabulary").write_text(FRAGMENT)
    with pytest.raises(BehaviourTextError, match=r"x is given twice; first in .*robot\.vocabulary, line 2"):
        parse(INCLUDING + "signals\n  x\n", tmp_path)


def test_edges_with_other_labels_are_other_edges():
    text = BEGIN + "  B: x > 2\ncycle\n  A -> B -> A\n  A -> B on jump -> A\n"
    assert len(parse(text).edges) == 3
    assert dataclasses.replace(parse(text), cycles=()).edges == parse(text).edges


LOADS = """behaviour "loads"
signals
  sway [m]
  dsway = d/dt sway [m/s]
  left_load [N]
  right_load [N]
  left_y [m]
  right_y [m]
mirror left <-> right, sway -> -sway, left_y -> -right_y
phases
  left_stands: left_load > 20 [N], right_load <= 20 [N], {}
  both: left_load > 20 [N], right_load > 20 [N], {}
cycle
  left_stands -> both -> right_stands
"""


@pytest.mark.parametrize(
    "condition",
    [
        "left_load + right_load > 700 [N]",
        "left_load > 700 [N] - right_load",
        "abs(left_load - right_load) <= 900 [N]",
        "max(left_load, right_load) > 30 [N]",
        "left_load * right_load > 10",
        "cos(left_load - right_load) > 0",
        "left_load - right_load < 3 [N], right_load - left_load < 3 [N]",
        "left_load + right_load > 700 [N] deadband 3 [N]",
        "not (left_load <= 5 [N] and right_load <= 5 [N])",
        "abs(sway) < 0.1 [m]",
        "-0.1 [m] < sway < 0.1 [m]",
        "sway = 0 within 0.1",
        "sway * dsway > 0",
        "left_y > right_y",
        "left_y - right_y > 0.1 [m]",
    ],
)
def test_what_means_the_same_in_the_mirror_is_its_own_image(condition):
    behaviour = parse(LOADS.format("sway > 0 [m]", condition))
    assert behaviour.phase_names == ("left_stands", "both", "right_stands")
    assert parse(to_text(behaviour)) == behaviour


@pytest.mark.parametrize(
    "condition",
    [
        "2 * left_load + right_load > 700 [N]",
        "sin(left_load - right_load) > 0",
        "sway > 0 [m]",
        "dsway > 0 [m/s]",
        "left_y + right_y > 0.1 [m]",
        "left_load - right_load < 3 [N]",
    ],
)
def test_what_means_another_thing_in_the_mirror_is_refused(condition):
    with pytest.raises(BehaviourTextError, match="phase both differs from its mirror image"):
        parse(LOADS.format("sway > 0 [m]", condition))


@pytest.mark.parametrize(
    ("said", "image"),
    [
        ("sway > 0 [m]", "sway < 0 [m]"),
        ("sway <= 0.1 [m] deadband 0.02 [m]", "sway >= -0.1 [m] deadband 0.02 [m]"),
        ("dsway < 2 [m/s]", "dsway > -2 [m/s]"),
        ("sway * 2 + dsway > 1", "-sway * 2 + -dsway > 1"),
        ("left_y > 0.1 [m]", "right_y < -0.1 [m]"),
        ("left_load > 5 [N]", "right_load > 5 [N]"),
    ],
)
def test_lateral_signals_have_the_other_sign_in_the_mirror(said, image):
    left, _, right = parse(LOADS.format(said, "true")).phases
    assert str(left.predicate).endswith(f" and {said}")
    assert str(right.predicate).endswith(f" and {image}")


@pytest.mark.parametrize(
    ("mirror", "told"),
    [
        ("swag -> -swag", "swag is not a signal"),
        ("sway -> -left_y", "the mirror image of sway is sway"),
        ("left_y -> -left_y", "the mirror image of left_y is right_y"),
        ("sway -> sway", "not expected here"),
    ],
)
def test_a_sign_that_cannot_change_so_is_refused(mirror, told):
    with pytest.raises(BehaviourTextError, match=told):
        parse(LOADS.format("true", "true").replace("sway -> -sway, left_y -> -right_y", mirror))
