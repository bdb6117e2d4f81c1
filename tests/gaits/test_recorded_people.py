"""People who were recorded while they walked, walk; a few strides of each come with gaitkit.

They are a healthy adult (Fukuchi et al., PeerJ 2018), a patient with Parkinson's disease (PhysioNet), and
a survivor of a stroke (Van Criekinge et al., Scientific Data 2023). The footfalls are gaitkit's: what was
annotated with the recording of the patient, and what its detectors find in the motion of the markers. In the
healthy adult's annotations strikes and toe-offs do not take turns, and of the survivor there are none.
"""

from itertools import pairwise

import numpy as np
import pytest

from coachable.automata.trace import Trace
from coachable.behaviours import Signal
from coachable.gaits.classify import gait
from coachable.gaits.measures import measures

gaitkit = pytest.importorskip("gaitkit", reason="needs the [dev] extra: pip install 'coachable[dev]'")


def walked(recording, strikes, offs):
    """The walk with each foot on the ground from its heel strikes to its toe-offs, in frames by side."""
    frames, rate = recording["angle_frames"], recording["fps"]
    hips = [[frame["landmark_positions"][f"{side}_hip"][0] for frame in frames] for side in ("left", "right")]
    x = np.mean(hips, axis=0) / 1000  # mm
    values = {"torso_x": x * np.sign(x[-1] - x[0])}
    for side in ("left", "right"):
        events = sorted([*((at, 1) for at in strikes[side]), *((at, 0) for at in offs[side])])
        assert all(one != other for (_, one), (_, other) in pairwise(events)), "each strike has its toe-off"
        contact = np.zeros(len(x))
        for at, down in [(0, 1 - events[0][1]), *events]:
            contact[at:] = down
        values[f"{side}_foot_contact"] = contact
    return Trace(np.arange(len(x)) / rate, tuple(map(Signal, values)), values)


def detected(name, method):
    recording = gaitkit.load_example(name)
    events = gaitkit.detect(recording, method=method)
    strikes, offs = (
        {side: [event["frame"] for event in getattr(events, f"{side}_{kind}")] for side in ("left", "right")}
        for kind in ("hs", "to")
    )
    return walked(recording, strikes, offs)


def annotated(name):
    recording = gaitkit.load_example(name)
    truth = recording["ground_truth"]
    return walked(recording, truth["hs_frames"], truth["to_frames"])


WALKS = {
    "annotated parkinson": lambda: annotated("parkinson"),
    **{
        f"{method} {name}": lambda name=name, method=method: detected(name, method)
        for name in ("healthy", "parkinson", "stroke")
        for method in ("bike", "zeni")
    },
}


@pytest.mark.parametrize("name", WALKS)
def test_people_walk(name):
    walk = WALKS[name]()
    found = measures(walk)
    assert gait(walk) == "walks"
    assert found["duty"] == pytest.approx(0.62, abs=0.05)
    assert found["lag"] == pytest.approx(0.5, abs=0.06)
    assert found["alternation"] == 1
    assert found["flight"] == 0
    # Twice in a stride both feet are down, each time for as long as the duty factor is over a half.
    assert found["overlap"] == pytest.approx(2 * found["duty"] - 1)
    assert 0.4 < found["speed"] < 1.8


def test_people_whose_stances_were_half_as_long_would_run():
    walk = detected("healthy", "bike")
    for side in ("left", "right"):
        contact = walk.values[f"{side}_foot_contact"]
        edges = np.flatnonzero(np.diff(contact, prepend=0, append=0))
        for begin, end in zip(edges[::2], edges[1::2], strict=True):
            contact[(begin + end) // 2 : end] = 0
    assert gait(walk) == "runs"
    assert measures(walk)["lag"] == pytest.approx(0.5, abs=0.06)
