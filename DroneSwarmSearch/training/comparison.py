"""How good a trained policy is: beside the baselines, on the same seas."""

from __future__ import annotations

import sys
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

from DroneSwarmSearch.evaluation.results import Evaluation, compare, save_csv
from DroneSwarmSearch.evaluation.run import evaluate
from DroneSwarmSearch.evaluation.statistics import Estimate
from DroneSwarmSearch.evaluation.suite import NamedSearch
from DroneSwarmSearch.evaluation.tables import figure, percent, print_table, signed
from DroneSwarmSearch.rules import Ending
from DroneSwarmSearch.scenario import resolve_scenario
from DroneSwarmSearch.training.run import INTERRUPTED

__all__ = ["BASELINES", "compare_with_baselines"]

BASELINES = ("random", "greedy-matrix", "greedy-posterior")

SEED = 1_000_000
"""Of the first episode: training begins its sequences of episodes with small seeds."""


def compare_with_baselines(
    policy: object,
    parameters: Mapping[str, Any],
    *,
    view: str = "drone",
    observation: str = "flat",
    episodes: int = 1000,
    name: str = "trained",
    folder: str | Path | None = None,
    baselines: Sequence[str] = BASELINES,
) -> list[Evaluation]:
    """Evaluate a policy and the baselines on the same seas, and print a table.

    Args:
        policy: a callable from observations to actions, see `evaluation.evaluate`.
        parameters: of the search, those of `DroneSwarmSearch` and "drones_positions".
        view: what the policy is shown, and what it returns; as for `evaluate`.
        observation: in which layout; as for `evaluate`.
        episodes: how many; at least 1.
        name: what the policy is called.
        folder: of the run; gets evaluation.csv, a row for each policy. After Ctrl-C the
            program then says that the run can be resumed, and ends with exit code 130.
        baselines: names of policies of the registry.

    Returns:
        The evaluations: the policy's, then the baselines' in their order.

    Raises:
        StorageError: evaluation.csv cannot be written.
        TypeError: an argument is of the wrong type, or what the policy returns.
        ValueError: an argument is out of its limits, or what the policy returns.
    """
    search = _search(parameters)
    usual: dict[str, Any] = {"episodes": episodes, "seed": SEED}
    try:
        mine = evaluate(policy, search, view=view, observation=observation, name=name, **usual)
        rivals = [evaluate(rival, search, **usual) for rival in baselines]
    except KeyboardInterrupt:
        if folder is None:
            raise
        print(
            f"interrupted during the comparison with the baselines; the training in {folder} "
            "is complete, and --resume compares again",
            file=sys.stderr,
        )
        raise SystemExit(INTERRUPTED) from None
    print_table(
        ["policy", "found, %", "time, steps", "crashes, %", "ahead of it, points", "steps earlier"],
        [_row(mine), *(_row(rival, mine) for rival in rivals)],
        words=1,
    )
    print(
        f"\n{episodes:,} episodes, the same seas for all; in brackets 95 % intervals. Found: "
        "everybody\nby the limit. Time: to find everybody, the limit where not all were found. "
        "Mishaps:\nepisodes in which drones collided or left the grid. The last two columns "
        f"say how far\n{name} is ahead of each baseline, episode by episode."
    )
    if folder is not None:
        save_csv(Path(folder) / "evaluation.csv", [mine, *rivals])
    return [mine, *rivals]


def _search(parameters: Mapping[str, Any]) -> NamedSearch:
    """The search with these parameters, the environment's defaults for all others."""
    of_scenario = dict(parameters)
    cells = of_scenario.pop("drones_positions", None)
    scenario = resolve_scenario(**of_scenario)
    drones = () if cells is None else tuple((int(x), int(y)) for x, y in cells)
    return NamedSearch("exercise", "Given by its parameters.", scenario, drones)


def _row(each: Evaluation, mine: Evaluation | None = None) -> list[str]:
    """A policy's figures, and how far another is ahead of it."""
    count = each.endings[Ending.COLLISION] + each.endings[Ending.LEFT_GRID]
    crashes = f"{100 * count / len(each.episodes):.1f}"
    row = [each.policy, percent(each.success), figure(each.time), crashes]
    if mine is None:
        return [*row, "", ""]
    ahead = compare(mine, each)
    return [*row, signed(ahead.success.scaled(100.0)), signed(_negative(ahead.time))]


def _negative(estimate: Estimate) -> Estimate:
    return Estimate(-estimate.value, -estimate.high, -estimate.low)
