"""Finished results in a folder: each file stands for itself, and is checked when it is read."""

import csv
import io
import zipfile
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from helpers import bound_by_time, data_of

from DroneSwarmSearch import Scenario
from DroneSwarmSearch.evaluation import (
    SUITE,
    NamedSearch,
    View,
    evaluate,
    leaderboard,
    roll_out,
    run,
    save_csv,
)

OWN = (
    "import numpy as np\n\ndef act(shown):\n    return np.full(shown['positions'].shape[:2], {})\n"
)


def small(name: str = "small", **changes: Any) -> NamedSearch:
    values = {
        "grid_size": 6,
        "n_drones": 2,
        "vector": (0.1, -0.1),
        "person_initial_position": (2, 2),
        "disperse_constant": 2,
        "timestep_limit": 12,
        "probability_of_detection": 0.8,
        **changes,
    }
    return NamedSearch(name, "For tests.", Scenario(**values), ((1, 1), (4, 5)))


TWO = {"person_initial_position": [(2, 2), (3, 4)]}  # so results have a sampling error


@pytest.fixture
def played(monkeypatch: pytest.MonkeyPatch) -> list[Any]:
    """The portions that are played; they have four episodes."""
    portions: list[Any] = []

    def noted(policy: Any, search: NamedSearch, seeds: Any, view: View, **how: Any) -> Any:
        portions.append(seeds)
        return roll_out(policy, search, seeds, view, **how)

    monkeypatch.setattr(run, "roll_out", noted)
    monkeypatch.setattr(run, "PORTION", 4)
    return portions


def files_in(folder: Path) -> list[Path]:
    return sorted((folder / "finished").iterdir())


@pytest.mark.parametrize("changes", [{}, TWO, {"mission": "coverage"}])
def test_a_finished_result_is_read(played, tmp_path, changes):
    def evaluated() -> Any:
        played.clear()
        return evaluate("greedy-matrix", small(**changes), episodes=10, out=tmp_path)

    first = evaluated()
    assert played
    again = evaluated()
    assert not played
    assert again.summary == first.summary
    assert data_of(again) == data_of(first)
    (file,) = files_in(tmp_path)
    file.unlink()
    anew = evaluated()
    assert played
    assert anew.summary == first.summary


OTHER_RUNS = {
    "episodes": {"episodes": 5},
    "seed": {"seed": 900},
    "parameters": {"search": small(disperse_constant=3, **TWO)},
    "limit": {"search": small(timestep_limit=9, **TWO)},
    "name": {"search": small("other", **TWO)},
    "view": {"view": View(bayesian_update=True)},
    "policy's name": {"name": "theirs"},
    "policy's file": {"text": OWN.format(5)},
    "deterministic": {"search": small(), "deterministic": True},
}


@pytest.mark.parametrize("changes", OTHER_RUNS.values(), ids=OTHER_RUNS)
def test_another_run_in_the_same_folder(played, tmp_path, changes):
    """It never shows the first one's figures, nor does the first one show its figures."""
    file = tmp_path / "mine.py"
    changes = {**changes}
    text = changes.pop("text", OWN.format(4))
    usual = {"search": small(**TWO), "episodes": 4, "name": "mine"}
    file.write_text(OWN.format(4), "utf-8")
    first = evaluate(f"{file}:act", **usual, out=tmp_path / "run")
    file.write_text(text, "utf-8")
    expected = evaluate(f"{file}:act", **{**usual, **changes})
    second = evaluate(f"{file}:act", **{**usual, **changes}, out=tmp_path / "run")
    assert data_of(second) == data_of(expected)
    file.write_text(OWN.format(4), "utf-8")
    played.clear()
    again = evaluate(f"{file}:act", **usual, out=tmp_path / "run")
    assert not played
    assert data_of(again) == data_of(first)


ALIKE = [
    "a/b",
    "a-b",
    "a b",
    "a_b",
    "a%2Fb",
    "..",
    ".",
    "../a",
    "-",
    "A/B",
    "ä/b",
    "a:b",
    "x" * 100,
]


def test_names_that_look_alike_have_files_of_their_own(tmp_path):
    searches = [small(name, timestep_limit=3 + n, **TWO) for n, name in enumerate(ALIKE)]
    for _ in range(2):
        for search in searches:
            stored = evaluate("greedy-matrix", search, episodes=3, out=tmp_path)
            assert data_of(stored) == data_of(evaluate("greedy-matrix", search, episodes=3))
    assert len(files_in(tmp_path)) == len(ALIKE)
    assert sorted(tmp_path.iterdir()) == [tmp_path / "finished"]


SLOW = """
import numpy as np


class Slow:
    def __init__(self, scenario):
        self.size = scenario.grid_size

    def prepare(self, drones):
        if self.size == 8:
            raise KeyboardInterrupt

    def __call__(self, shown):
        return np.full(shown["positions"].shape[:2], 5)
"""


def test_an_interruption_while_policies_are_prepared_loses_no_other_result(tmp_path):
    path = tmp_path / "slow.py"
    path.write_text(SLOW, "utf-8")
    searches = [small("six"), small("eight", grid_size=8), small("seven", grid_size=7)]
    out = tmp_path / "out"
    with pytest.raises(KeyboardInterrupt):
        leaderboard(
            ["random"],
            searches,
            added=[f"{path}:Slow"],
            episodes=4,
            out=out,
            bounds=False,
            progress=False,
        )
    kept = {file.name.rsplit(".", 2)[0] for file in (out / "finished").iterdir()}
    assert kept == {"random.six", "random.eight", "random.seven", "Slow.six"}


@pytest.mark.parametrize("name", ["", " ", "\0", "a\nb", "x" * 101, "\u202e"])
def test_names_must_be_printable(name):
    message = "name must be text of 1 to 100 printable characters"
    with pytest.raises(ValueError, match=message):
        small(name)
    with pytest.raises(ValueError, match=message):
        evaluate("random", small(), episodes=1, name=name)


def test_several_runs_at_once(tmp_path):
    """As of several processes: all succeed, and each keeps its own figures."""
    seeds = [0, 900, 0, 77]

    def evaluated(seed: int) -> Any:
        return evaluate("random", small(**TWO), episodes=6, seed=seed, out=tmp_path)

    with ThreadPoolExecutor(4) as pool:
        found = list(pool.map(evaluated, seeds))
    for seed, result in zip(seeds, found, strict=True):
        expected = evaluate("random", small(**TWO), episodes=6, seed=seed)
        assert data_of(result) == data_of(evaluated(seed)) == data_of(expected)


def rewritten(file: Path, **arrays: Any) -> None:
    """Replace arrays of a result by others."""
    with np.load(file) as stored:
        content = {**stored, **arrays}
    np.savez_compressed(
        file, **{name: array for name, array in content.items() if array is not ...}
    )


def with_text(file: Path, text: bytes) -> None:
    file.write_bytes(text)


def with_member(file: Path, name: str, text: bytes) -> None:
    with zipfile.ZipFile(file, "w") as archive:
        archive.writestr(name, text)


def without_its_end(file: Path) -> None:
    file.write_bytes(file.read_bytes()[:-200])


def renamed(file: Path) -> None:
    """The file of another run under the name of this one."""
    evaluate("random", small(), episodes=5, out=file.parents[1])
    (other,) = (path for path in files_in(file.parents[1]) if path != file)
    other.replace(file)


PICKLED = io.BytesIO()
np.save(PICKLED, np.array([{}], object), allow_pickle=True)
NAN = {"returns": np.full(4, np.nan)}
DAMAGES = {
    "empty": lambda file: with_text(file, b""),
    "text": lambda file: with_text(file, b"results"),
    "cut": without_its_end,
    "other members": lambda file: with_member(file, "a.txt", b"x"),
    "pickled": lambda file: with_member(file, "endings.npy", PICKLED.getvalue()),
    "an array of less than nothing": lambda file: with_member(file, "endings.npy", b""),
    "a missing array": lambda file: rewritten(file, endings=...),
    "a further array": lambda file: rewritten(file, more=np.zeros(4)),
    "three episodes": lambda file: rewritten(file, returns=np.zeros(3)),
    "a row too few": lambda file: rewritten(file, curves=np.zeros((1, 12))),
    "NaN": lambda file: rewritten(file, **NAN),
    "infinite": lambda file: rewritten(file, curves=np.full((1, 13), np.inf)),
    "text in place of numbers": lambda file: rewritten(file, returns=np.array(["a"] * 4)),
    "objects": lambda file: rewritten(file, returns=np.array([{}] * 4, object)),
    "other facts": lambda file: rewritten(file, facts=np.array("{}")),
    "another run's": renamed,
}


@pytest.mark.parametrize("damage", DAMAGES.values(), ids=DAMAGES)
def test_damaged_files_are_named(tmp_path, damage):
    def evaluated() -> Any:
        return evaluate("random", small(), episodes=4, out=tmp_path)

    first = evaluated()
    (file,) = files_in(tmp_path)
    damage(file)
    with pytest.raises(
        ValueError, match=r"damaged: .*; delete it, and the result is computed again"
    ):
        evaluated()
    with pytest.raises(ValueError, match=file.name):
        evaluated()
    file.unlink()
    assert data_of(evaluated()) == data_of(first)


def test_damaged_bounds_are_named(tmp_path, monkeypatch):
    curve = np.linspace(0.0, 0.9, SUITE["pond"].scenario.timestep_limit + 1)
    monkeypatch.setattr(run, "success_bound", lambda *_: bound_by_time(curve))
    board = leaderboard(["random"], ["pond"], episodes=2, out=tmp_path, progress=False)
    (file,) = (path for path in files_in(tmp_path) if path.name.startswith("pond.bound"))
    limit = board.evaluations[0].limit
    rewritten(file, by_time=np.full(limit + 1, np.nan))
    with pytest.raises(ValueError, match="damaged: by_time must be finite"):
        leaderboard(["random"], ["pond"], episodes=2, out=tmp_path, progress=False)


def test_spreadsheets_execute_no_cell(tmp_path):
    names = ["=1+1", "+1", "-1", "@SUM(A1)", "plain", "a,b"]
    results = [evaluate("random", small(name), episodes=2, name=name) for name in names]
    save_csv(tmp_path / "results.csv", results)
    with (tmp_path / "results.csv").open(newline="", encoding="utf-8") as file:
        rows = list(csv.DictReader(file))
    shown = ["'=1+1", "'+1", "'-1", "'@SUM(A1)", "plain", "a,b"]
    assert [row["policy"] for row in rows] == [row["search"] for row in rows] == shown
    assert float(rows[0]["mean_return"]) == results[0].mean_return  # numbers stay as they are
