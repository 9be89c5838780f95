"""Comparison of a trained policy with the baselines, on the same episodes."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

from DroneSwarmSearch.evaluation.results import Evaluation, compare, save_csv
from DroneSwarmSearch.evaluation.run import evaluate
from DroneSwarmSearch.evaluation.suite import NamedSearch
from DroneSwarmSearch.evaluation.tables import figure, percent, print_table, signed
from DroneSwarmSearch.evaluation.view import View
from DroneSwarmSearch.rules import Ending
from DroneSwarmSearch.scenario import resolve_scenario

__all__ = ["BASELINES", "compare_with_baselines"]

BASELINES = ("random", "greedy-matrix", "greedy-posterior")

SEED = 1_000_000
"""Seed of the first episode; training usually starts from small seeds."""

HEADERS = ["policy", "success, %", "time, steps", "crashes, %", "lead, points", "lead, steps"]


def compare_with_baselines(
    policy: object,
    parameters: Mapping[str, Any],
    *,
    view: View | str = View("drone", "flat"),  # noqa: B008 (it is frozen)
    episodes: int = 1000,
    name: str = "trained",
    folder: str | Path | None = None,
    baselines: Sequence[str] = BASELINES,
) -> list[Evaluation]:
    """Evaluate a policy and the baselines on the same episodes, and print a table.

    Args:
        policy: a callable from observations to actions, see `evaluation.evaluate`.
        parameters: those of `DroneSwarmSearch`, and optionally "drones_positions".
        view: what the policy sees and returns, as for `evaluate`.
        episodes: number of episodes; at least 1.
        name: the policy's name in the table.
        folder: the run's folder; evaluation.csv is written there, one row per policy.
        baselines: names of policies of the package.

    Returns:
        The evaluation of the policy, then those of the baselines in order.

    Raises:
        StorageError: evaluation.csv cannot be written.
        TypeError: an argument, or what the policy returns, has the wrong type.
        ValueError: an argument, or what the policy returns, is out of range.
    """
    search = _search(parameters)
    shared: dict[str, Any] = {"episodes": episodes, "seed": SEED}
    trained = evaluate(policy, search, view=view, name=name, **shared)
    others = [evaluate(baseline, search, **shared) for baseline in baselines]
    rows = [[*_figures(trained), "", ""]]
    rows += [[*_figures(other), *_lead(trained, other)] for other in others]
    print_table(HEADERS, rows, words=1)
    print(
        f"\n{episodes:,} episodes, the same for all policies; 95% intervals in parentheses; "
        "success and time without one are exact.\n"
        "Success: all persons found within the limit. Time: until all are found, or the limit.\n"
        "Crashes: episodes that end with a collision or with a drone off the grid.\n"
        f"Lead: how far {name} is ahead of each baseline, in percentage points and in steps."
    )
    if folder is not None:
        save_csv(Path(folder) / "evaluation.csv", [trained, *others])
    return [trained, *others]


def _search(parameters: Mapping[str, Any]) -> NamedSearch:
    of_scenario = dict(parameters)
    positions = of_scenario.pop("drones_positions", None)
    scenario = resolve_scenario(**of_scenario)
    drones = () if positions is None else tuple((int(x), int(y)) for x, y in positions)
    return NamedSearch("the search", "The search of the comparison.", scenario, drones)


def _figures(each: Evaluation) -> list[str]:
    crashes = each.endings[Ending.COLLISION] + each.endings[Ending.LEFT_GRID]
    share = f"{100 * crashes / len(each.episodes):.1f}"
    return [each.policy, percent(each.success), figure(each.time), share]


def _lead(trained: Evaluation, other: Evaluation) -> list[str]:
    success = compare(trained, other).success.scaled(100.0)
    return [signed(success), signed(compare(other, trained).time)]
