"""docs/evaluation.md: its plan is one, and what it says of commands they take."""

import re
from pathlib import Path

import pytest

from coachable import cli
from coachable.experiments.plan import parse_plan
from coachable.rewards.forms import Schedule, Stay

GUIDE = Path(__file__).parents[1].joinpath("docs", "evaluation.md").read_text(encoding="utf-8")
TOML = re.findall(r"^```toml\n(.*?)^```$", GUIDE, re.DOTALL | re.MULTILINE)
COMMANDS = re.findall(r"^coachable (\w+) runs", GUIDE, re.MULTILINE)


def test_its_plan_is_one():
    plan = parse_plan(TOML[-1], "mine.toml")
    orthant, alone = plan.reward_setups
    assert (plan.problem.form_of(orthant), plan.problem.form_of(alone)) == (Stay(), Schedule(1.0))
    assert (orthant.time_limit, alone.time_limit) == ("terminates", "truncates")
    assert plan.deterministic == ("expected-action",)
    for line in TOML[0].splitlines():
        assert parse_plan(TOML[-1].replace('deterministic = "expected-action"', line), "mine.toml")


@pytest.mark.parametrize("command", COMMANDS)
def test_its_commands_take_a_rule(command, capsys):
    with pytest.raises(SystemExit):
        cli.main([command, "--help"])
    assert "clipped-mean|expected-action" in capsys.readouterr().out
