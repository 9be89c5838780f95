"""The benchmarks in benchmarks: every case runs, and the results are consistent."""

import json
import sys
from pathlib import Path
from typing import Any

import numpy as np
import pytest

sys.path.append(str(Path(__file__).parents[1] / "benchmarks"))

import bench_vector
import cases
from bench_vector import GROUPS
from cases import Size

SMALL = ["--short", "--sizes", "5x2", "--num-envs", "1", "3"]
COMPARED = ["batch", "training", "posterior", "forecasts", "situations", "views"]


@pytest.fixture(autouse=True)
def _no_peers(monkeypatch):
    for name in ("DSSE", "jax", "jaxmarl"):
        monkeypatch.setitem(sys.modules, name, None)


def measured(path: Path, *arguments: str) -> dict[str, Any]:
    """Run the benchmark and return its results."""
    bench_vector.main([*SMALL, *arguments, "--json", str(path)])
    results: dict[str, Any] = json.loads(path.read_text("utf-8"))
    return results


@pytest.mark.thorough
def test_every_ratio_is_measured(tmp_path):
    results = measured(tmp_path / "results.json", "--only", *COMPARED)
    assert results["versions"]["numpy"] == np.__version__
    (size,) = results["sizes"]
    assert (size["grid_size"], size["n_drones"], size["left_out"]) == (5, 2, [])
    assert {(each["name"], each["num_envs"]) for each in size["ratios"]} == {
        (f"{a.name} / {b.name}", n) for name in COMPARED for a, b in GROUPS[name] for n in (1, 3)
    }
    for each in (*size["steps_per_second"], *size["ratios"]):
        assert 0 < each["lower"] <= each["median"] <= each["upper"]


@pytest.mark.skipif(sys.platform != "linux", reason="memory is read from /proc")
def test_memory_is_measured(tmp_path):
    memory = measured(tmp_path / "results.json", "--only", "memory")["memory"]
    assert 0 < memory["peak_mib_before"] <= memory["peak_mib"] < 1000
    assert memory["growth_mib"] >= 0


def test_missing_packages_are_skipped(tmp_path, capsys):
    results = measured(tmp_path / "results.json", "--only", "peers", "coin-game")
    assert [size["ratios"] for size in results["sizes"]] == [[], []]
    shown = capsys.readouterr().out
    assert "skipped: DSSE, not installed" in shown
    assert "skipped: JaxMARL coin_game, scan, not installed" in shown
    assert "python -m pip install jaxmarl" in shown


@pytest.mark.thorough
@pytest.mark.parametrize(
    "case",
    list(dict.fromkeys(each for name in COMPARED for ratio in GROUPS[name] for each in ratio)),
    ids=lambda case: case.name,
)
def test_a_case_counts_the_steps_that_it_makes(case):
    num_envs = 4 if case.batched else 1
    run = case.make(Size(7, 2), num_envs)
    assert run(1) == num_envs
    made = run(200)
    resets_at_once = case in (cases.TRAINING, cases.TRAINING_SAMPLER)
    if case.batched and not resets_at_once:
        assert 100 * num_envs < made < 200 * num_envs, "rows that reset do not count"
    else:
        assert made == 200 * num_envs
