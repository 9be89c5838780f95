"""Short named episodes, replayed and compared with their traces line by line."""

import pytest
from golden.regenerate import FOLDER, LETTERS, SCENARIOS, path_of, trace

from DroneSwarmSearch import Action


@pytest.mark.parametrize("name", SCENARIOS)
def test_golden(name):
    path = path_of(name)
    assert path.exists(), f"no trace of {name!r}: run tests/golden/regenerate.py"
    recorded = path.read_text(encoding="utf-8").splitlines()
    replayed = trace(SCENARIOS[name]).splitlines()
    for number, (now, then) in enumerate(zip(replayed, recorded, strict=False), start=1):
        assert now == then, f"{path.name}, line {number}"
    assert len(replayed) == len(recorded)


def test_every_trace_has_a_scenario():
    assert {path.stem for path in FOLDER.glob("*.txt")} == set(SCENARIOS)


def test_the_scenarios_use_every_action_and_reach_every_ending():
    assert set(LETTERS.values()) == set(Action)
    letters = {letter for scenario in SCENARIOS.values() for letter in scenario.steps}
    assert letters - {" "} == set(LETTERS)
    traces = "\n".join(trace(scenario) for scenario in SCENARIOS.values())
    for words in (
        "every person was found",
        "collided",
        "left the grid",
        "the time limit",
        "less than 1%",
    ):
        assert words in traces
