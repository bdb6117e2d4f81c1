"""What the measurements mean: ours beside each opponent, by medians over rounds."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from statistics import median

from bench.child import Measurement
from bench.table import Row, significant
from coachable.experiments.layout import WIDEST_BATCH

STEPS_A_RUN = 501_760
STEPS_AN_UPDATE = 2048
RUNS_A_STUDY = 60
ALONE = "wrapper alone"


@dataclass(frozen=True)
class Results:
    """Measurements by name of the program, one a round."""

    measured: Mapping[str, Sequence[Measurement]]

    def cost(self, name: str) -> tuple[float, float]:
        """CPU-seconds and wall seconds of one call."""
        turns = self.measured[name]
        return median(turn.usual.cpu for turn in turns), median(turn.usual.wall for turn in turns)

    def rate(self, name: str) -> float:
        """Units per CPU-second."""
        return median(turn.rate for turn in self.measured[name])

    def minutes(self, name: str, num_steps: int) -> float:
        """How long so many training steps take on the wall."""
        return num_steps / median(turn.wall_rate for turn in self.measured[name]) / 60

    def ratio(self, ours: str, theirs: str) -> float:
        """How many times theirs our rate per CPU-second is, round by round."""
        rounds = zip(self.measured[ours], self.measured[theirs], strict=True)
        return median(our_turn.rate / their_turn.rate for our_turn, their_turn in rounds)

    def wall_ratio(self, ours: str, theirs: str) -> float:
        """The same by the wall clock."""
        rounds = zip(self.measured[ours], self.measured[theirs], strict=True)
        return median(our_turn.wall_rate / their_turn.wall_rate for our_turn, their_turn in rounds)

    def faster(self, ours: str, theirs: str) -> str:
        """Both ratios in words."""
        cpu, wall = self.ratio(ours, theirs), self.wall_ratio(ours, theirs)
        return f"{significant(cpu)} × a CPU-s, {significant(wall)} × on the wall"


def report(measured: Mapping[str, Sequence[Measurement]]) -> list[Row]:
    """The rows of the table; those about programs that were not measured are left out."""
    results = Results(measured)
    return [
        row
        for rows, needed in (
            (_steps, ["steps"]),
            (_monitor, ["monitor", "monitor, one by one"]),
            (_vectors, ["vector 1"]),
            (_wrapper, [ALONE]),
            (_wrapper_in_training, [f"wrapper in training {name}" for name in ("alone", "with coachable")]),
            (_described, ["described Walker2d coachable"]),
            (_training, ["lanes 1"]),
            (_sbx, ["lanes 1", "sbx"]),
            (_update, ["update", "sgemm 1024", "sgemm 64"]),
            (_scaling, ["lanes 1", "compilation, cold", "compilation, cached"]),
        )
        if all(name in measured for name in needed)
        for row in rows(results)
    ]


def _steps(results: Results) -> list[Row]:
    return [
        _step_row(results, f"environment: coachable, {WIDEST_BATCH} lanes side by side, one thread", "steps"),
        *(
            _step_row(results, f"… {name}", name, results.faster("steps", name), "≥ 300 ×")
            for name in _named(results, "SciPy")
        ),
    ]


def _monitor(results: Results) -> list[Row]:
    def row(title: str, name: str, comparison: str = "", asked_for: str = "", unit: str = "samples") -> Row:
        figure = f"{significant(results.rate(name))} {unit}/CPU-s"
        return Row(title, figure, *results.cost(name), comparison, asked_for)

    ours, singly = "monitor", "monitor, one by one"
    return [
        row("monitor: coachable, in chunks", ours, asked_for="≥ 1,000,000"),
        row("… sample by sample", singly),
        *(
            # Who has the whole trace is compared with chunks, who is told sample by sample with the same.
            row(f"… {name}", name, results.faster(ours if name.endswith("offline") else singly, name))
            for name in (*_named(results, "rtamt"), *_named(results, "pyrewardmachines"))
        ),
        *(
            row(f"{name}, 100,000 at once", name, asked_for="≥ 10,000,000", unit="states")
            for name in _named(results, "classifier")
        ),
    ]


def _vectors(results: Results) -> list[Row]:
    one, *more = _named(results, "vector")

    def row(name: str, comparison: str = "", asked_for: str = "") -> Row:
        figure = f"{1e6 / results.rate(name):.0f} CPU-µs a step"
        return Row(f"Gymnasium: {name}", figure, *results.cost(name), comparison, asked_for)

    times = [f"{significant(results.wall_ratio(one, name))} × one on the wall" for name in more]
    return [row(one), *(row(name, text, "≤ 5 ×") for name, text in zip(more, times, strict=True))]


def _wrapper(results: Results) -> list[Row]:
    """What wrappers add to a step. The simple behaviour is what others are paid by, too."""

    def row(name: str, asked_for: str = "") -> Row:
        microseconds = _added(results, name, ALONE)
        figure = f"{microseconds:+.1f} CPU-µs a step, {100 * _share(results, name, ALONE):+.1f} %"
        times = microseconds / _added(results, ours, ALONE)
        comparison = "" if "coachable" in name else f"{significant(times)} × what coachable adds"
        return Row(f"… {name.removeprefix('wrapper ')}", figure, *results.cost(name), comparison, asked_for)

    ours = "wrapper with coachable"
    others = [name for name in _named(results, "wrapper with") if name != ours]
    figure = f"{1e6 / results.rate(ALONE):.1f} CPU-µs a step"
    return [
        Row("Walker2d-v5: a step", figure, *results.cost(ALONE)),
        row(ours, "< 5 %"),
        *(row(name, "< 5 %" if "coachable" in name else "") for name in others),
    ]


def _wrapper_in_training(results: Results) -> list[Row]:
    alone, wrapped = (f"wrapper in training {name}" for name in ("alone", "with coachable"))
    share = f"{100 * _share(results, wrapped, alone):+.1f} %"
    return [
        _step_row(results, "Walker2d-v5: sb3 PPO, one thread", alone),
        _step_row(results, "… with coachable", wrapped, share, "< 10 %"),
    ]


def _described(results: Results) -> list[Row]:
    """Training in Gymnasium environments, beside stable-baselines3 and the simulator by itself."""
    rows = []
    for ours in (name for name in _named(results, "described") if name.endswith(" coachable")):
        robot = ours.removesuffix(" coachable")
        theirs, alone = f"{robot} stable-baselines3", f"{robot} mj_step"
        walk = f"{robot} without learning"
        share = f"{100 * results.ratio(ours, alone):.0f} % of it"
        first = not rows
        rows += [
            _step_row(results, f"training: {ours}", ours),
            _step_row(results, "… stable-baselines3", theirs, results.faster(ours, theirs), "≥ 5 ×" * first),
            _step_row(results, "… without learning: simulator, signals, reward", walk),
            _step_row(results, "… mj_step alone", alone, share, "≥ 65 %" * first),
        ]
    return rows


def _training(results: Results) -> list[Row]:
    study = _study(results)
    minutes = results.minutes(study, STEPS_A_RUN * RUNS_A_STUDY)
    whole = f"{RUNS_A_STUDY} runs in {minutes:.1f} min"
    return [
        _step_row(results, f"training: coachable, {study}", study, whole, "≤ 10 min"),
        *(
            _step_row(results, f"… {name}", name, results.faster(study, name), "≥ 130 ×")
            for name in _named(results, "sb3")
        ),
    ]


def _sbx(results: Results) -> list[Row]:
    one, study = _named(results, "lanes")[0], _study(results)
    minutes = f"a run in {results.minutes('sbx', STEPS_A_RUN):.1f} min; "
    return [
        _step_row(results, "… sbx, one run", "sbx", minutes + results.faster(one, "sbx"), "> 1 ×"),
        _step_row(results, f"… sbx, {RUNS_A_STUDY} runs", "sbx", results.faster(study, "sbx"), "> 1 ×"),
    ]


def _update(results: Results) -> list[Row]:
    def row(title: str, name: str, comparison: str = "", asked_for: str = "") -> Row:
        figure = f"{results.rate(name) / 1e9:.1f} GFLOP/CPU-s"
        return Row(title, figure, *results.cost(name), comparison, asked_for)

    def share(name: str) -> str:
        return f"{100 * results.ratio('update', name):.0f} % of it"

    return [
        row("PPO update: coachable, one thread", "update"),
        row("… sgemm 1024³, one thread", "sgemm 1024", share("sgemm 1024"), "≥ 35 %"),
        row("… sgemm 64³, one thread", "sgemm 64", share("sgemm 64")),
    ]


def _scaling(results: Results) -> list[Row]:
    rows = []
    for name in _named(results, "lanes"):
        milliseconds = 1e3 * STEPS_AN_UPDATE / results.rate(name)
        # The first round may compile, which takes more memory than the training does.
        memory = min(turn.megabytes for turn in results.measured[name])
        figure = f"{milliseconds:.1f} CPU-ms a lane's update"
        rows.append(Row(f"training: {name}", figure, *results.cost(name), f"{memory:.0f} MB at most"))
    for name, asked_for in (("compilation, cold", "< 20 s"), ("compilation, cached", "")):
        cpu, wall = results.cost(name)
        rows.append(Row(name, f"{wall:.1f} s", cpu, wall, "", asked_for))
    return rows


def _step_row(results: Results, title: str, name: str, comparison: str = "", asked_for: str = "") -> Row:
    figure = f"{significant(results.rate(name))} steps/CPU-s"
    return Row(title, figure, *results.cost(name), comparison, asked_for)


def _added(results: Results, name: str, alone: str) -> float:
    """What a wrapper adds to a step [CPU-µs]."""
    return _share(results, name, alone) * 1e6 / results.rate(alone)


def _share(results: Results, name: str, alone: str) -> float:
    """The same as a share of a step without it, by the median over rounds."""
    return results.ratio(alone, name) - 1


def _named(results: Results, beginning: str) -> list[str]:
    return [name for name in results.measured if name.startswith(beginning)]


def _study(results: Results) -> str:
    """Training all lanes of the paper's study, or of what a quick run has instead."""
    name = f"lanes {RUNS_A_STUDY}"
    return name if name in results.measured else _named(results, "lanes")[-1]
