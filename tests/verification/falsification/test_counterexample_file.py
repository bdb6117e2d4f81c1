import json

import numpy as np
import pytest

from coachable.behaviours.library import load_behaviour
from coachable.cli import main
from coachable.foundation.errors import RunFolderError
from coachable.plants.compass import CompassWalker
from coachable.plants.controllers import NoTorque
from coachable.verification.falsification.counterexample_file import (
    load_counterexample,
    write_counterexamples,
)
from coachable.verification.falsification.fall_search import Fall, SearchResult
from coachable.verification.falsification.falsify import Counterexample, Falsification
from coachable.verification.falsification.perturbation import HeldTorques
from coachable.verification.falsification.resimulation import resimulate


@pytest.fixture(scope="module")
def found():
    """Pushed by hand: a walker without torques falls anyhow."""
    pushes = HeldTorques(1.0, seconds=0.2, hold=10, x0=CompassWalker().start)
    plant = CompassWalker()
    point = np.linspace(-1, 0.5, pushes.size(plant))
    starts, torques = pushes.at(plant, point[None])
    walk = resimulate(plant.restated(), NoTorque(2), starts[0], torques[0], "free", 5.0)
    fall = Fall("cma-es", point, walk.seconds)
    search = SearchResult("cma-es", 16, -0.8, 3, (fall,))
    one = Counterexample(fall, starts[0], torques[0], walk)
    return Falsification(pushes, "free", 5.0, 0, (search, search), (one, one), ())


@pytest.fixture
def files(found, tmp_path):
    return write_counterexamples(
        tmp_path, "sparse-3", [found], CompassWalker(), load_behaviour("compass-walking")
    )


def test_a_counterexample_is_written_and_read(files, found, tmp_path):
    assert [path.name for path in files] == ["sparse-3-1.json", "sparse-3-2.json"]
    assert files[0].parent == tmp_path / "counterexamples"
    shown = load_counterexample(files[0])
    walk = found.counterexamples[0].walk
    points = CompassWalker().kinematics(walk.states, walk.foot_x)
    np.testing.assert_allclose(shown.motion.points, points, rtol=1e-12)
    assert shown.motion.time[-1] == walk.seconds
    assert shown.behaviour == load_behaviour("compass-walking")
    data = json.loads(files[0].read_text(encoding="utf-8"))
    assert data["perturbation"] == {
        "kind": "HeldTorques",
        "bound": 1.0,
        "seconds": 0.2,
        "hold": 10,
        "x0": [0.0, 0.0, -0.4, 2.0],
    }
    assert len(data["disturbance"]) == 20
    assert data["size"] == 1.0


def test_older_ones_of_the_lane_are_gone_and_no_others(files, found, tmp_path):
    neighbour = files[0].with_name("forward-sparse-3-1.json")
    neighbour.write_text("{}")
    fewer = Falsification(**vars(found) | {"counterexamples": found.counterexamples[:1]})
    write_counterexamples(tmp_path, "sparse-3", [fewer], CompassWalker(), load_behaviour("compass-walking"))
    left = {path.name for path in files[0].parent.iterdir()}
    assert left == {"sparse-3-1.json", "forward-sparse-3-1.json"}


def test_those_of_several_searches_are_counted_through(found, tmp_path):
    behaviour = load_behaviour("compass-walking")
    paths = write_counterexamples(tmp_path, "x-1", [found, found], CompassWalker(), behaviour)
    assert [load_counterexample(path).title for path in paths] == [
        f"x-1, counterexample {number}" for number in (1, 2, 3, 4)
    ]


def test_where_nothing_was_found_nothing_is_written(found, tmp_path):
    none = Falsification(**vars(found) | {"counterexamples": ()})
    assert write_counterexamples(tmp_path, "x-1", [none], CompassWalker(), load_behaviour("hop")) == ()
    assert not list(tmp_path.iterdir())


def test_a_counterexample_can_be_watched(files, capsys, tmp_path):
    picture = tmp_path / "fall.png"
    main(["watch", str(files[1]), "-o", str(picture)])
    assert picture.read_bytes().startswith(b"\x89PNG")
    assert "sparse-3, counterexample 2" in capsys.readouterr().out


@pytest.mark.parametrize(
    ("change", "said"),
    [
        (lambda data: data | {"format_version": 2}, "format_version 2"),
        (lambda data: {k: v for k, v in data.items() if k != "walk"}, "lacks 'walk'"),
        (lambda data: data | {"walk": data["walk"] | {"t": [0.0]}}, "not of one length"),
        (lambda data: data | {"behaviour": "nonsense"}, "damaged"),
        (lambda data: data | {"plant": {"mass": 1}}, "damaged"),
        (lambda data: [data], "damaged"),
    ],
)
def test_a_damaged_file_is_one_clear_message(files, change, said):
    data = json.loads(files[0].read_text(encoding="utf-8"))
    files[0].write_text(json.dumps(change(data)))
    with pytest.raises(RunFolderError, match=said):
        load_counterexample(files[0])


def test_a_missing_or_cut_file_is_one_clear_message(files, tmp_path):
    with pytest.raises(RunFolderError, match="missing"):
        load_counterexample(tmp_path / "no.json")
    files[0].write_bytes(files[0].read_bytes()[:100])
    with pytest.raises(RunFolderError, match="damaged"):
        load_counterexample(files[0])
