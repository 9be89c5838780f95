"""Everything that a command prints on a terminal of 80 columns fits it."""

import pytest

from DroneSwarmSearch import cli
from DroneSwarmSearch.evaluation.text_tables import print_table


def assert_fits(text: str) -> None:
    assert text
    assert [line for line in text.split("\n") if len(line) > 80] == []


@pytest.fixture(autouse=True)
def _terminal(monkeypatch):
    monkeypatch.setenv("COLUMNS", "80")


@pytest.mark.parametrize(
    "arguments",
    [
        "play --text",
        "play gale --text --policy greedy-posterior",
        "play fleet --text --policy parallel-sweep",
        "evaluate --list",
        "evaluate random pond man-overboard --episodes 20",
        "evaluate greedy-posterior pond --mission coverage --episodes 20",
    ],
)
def test_commands(arguments, capsys):
    assert cli.main(arguments.split()) == 0
    assert_fits(capsys.readouterr().out)


@pytest.mark.thorough
def test_a_leaderboard(tmp_path, capsys):
    policies = "random parallel-sweep creeping-line expanding-square sector-search greedy-matrix"
    arguments = f"leaderboard --no-bound --episodes 20 --searches pond --policies {policies}"
    assert cli.main([*arguments.split(), "greedy-posterior", "--out", str(tmp_path)]) == 0
    assert_fits(capsys.readouterr().out)


def test_a_wide_table_is_broken_and_loses_nothing(capsys):
    headers = ["search", *(f"the figures of {number}, %" for number in range(9))]
    rows = [[name, *(f"{name}-{number:08}" for number in range(9))] for name in ("pond", "gale")]
    print_table(headers, rows, words=1)
    output = capsys.readouterr().out
    assert_fits(output)
    tables = output.split("\n\n")
    assert len(tables) > 1
    for table in tables:
        *_, pond, gale = table.strip().split("\n")
        assert pond.startswith("pond  ")
        assert gale.startswith("gale  ")
    for cell in (*rows[0], *rows[1]):
        assert cell in output
