"""The task of the training examples, and the comparison with the baselines."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

from DroneSwarmSearch.core.named_search import NamedSearch
from DroneSwarmSearch.core.rules import Ending
from DroneSwarmSearch.core.scenario import resolve_scenario
from DroneSwarmSearch.evaluation.recording import record
from DroneSwarmSearch.evaluation.results import Evaluation, compare, save_csv
from DroneSwarmSearch.evaluation.run import evaluate
from DroneSwarmSearch.evaluation.text_tables import figure, percent, print_table, signed
from DroneSwarmSearch.layouts.view import View

TRAINING_TASK: dict[str, Any] = {
    "grid_size": 10,
    "n_drones": 2,
    "vector": (0.2, 0.1),
    "person_initial_position": (4, 3),
    "disperse_constant": 5,
    "timestep_limit": 50,
    "bayesian_update": True,
}
"""Parameters of `DroneSwarmSearch`: two drones search a 10 x 10 grid for a drifting person.

The matrix is the posterior, so a policy needs no memory; the task takes minutes to learn.
"""

SEED = 1_000_000  # seed of the first episode; training usually starts from small seeds


def compare_with_baselines(
    policy: object,
    parameters: Mapping[str, Any],
    *,
    view: View | str | None = None,
    episodes: int = 1000,
    name: str = "trained",
    folder: str | Path | None = None,
    baselines: Sequence[str] = ("random", "greedy-matrix", "greedy-posterior"),
) -> list[Evaluation]:
    """Evaluate a policy and the baselines on the same episodes, and print a table.

    Args:
        policy: as for `evaluation.evaluate`.
        parameters: those of `DroneSwarmSearch`, and optionally "drones_positions".
        view: what the policy sees and returns, as for `evaluate`.
        episodes: number of episodes; at least 1.
        name: the policy's name in the table.
        folder: evaluation.csv is written there, one row per policy; search.json, which the
            commands read as a search; and video.gif, the episode with seed 0. If `policy` is a
            string, the command that plays that episode in the window is printed.
        baselines: names of policies of the package.

    Returns:
        The evaluation of the policy, then those of the baselines in order.

    Raises:
        ImportError: `folder` is given, and the package of the extra "video" is missing.
    """
    given = dict(parameters)
    drones = given.pop("drones_positions", ())
    reason = f"An episode that {name} has not trained on."
    search = NamedSearch("task", reason, resolve_scenario(**given), drones)
    trained = evaluate(policy, search, view=view, name=name, episodes=episodes, seed=SEED)
    every = [trained]
    every += [evaluate(each, search, episodes=episodes, seed=SEED) for each in baselines]
    rows = []
    for each in every:
        crashes = each.endings[Ending.COLLISION] + each.endings[Ending.LEFT_GRID]
        lead = ["", ""]
        if each is not trained:
            success = compare(trained, each).success.scaled(100.0)
            lead = [signed(success), signed(compare(each, trained).time)]
        figures = percent(each.success), figure(each.time), f"{100 * crashes / episodes:.1f}"
        rows.append([each.policy, *figures, *lead])
    headers = ["success, %", "time, steps", "crashes, %", "lead, points", "lead, steps"]
    print_table(["policy", *headers], rows, words=1)
    print(
        f"\n{episodes:,} episodes, the same for all policies; 95% intervals in parentheses;\n"
        "success and time without one are exact.\n"
        "Success: all persons found within the limit. Time: until then, or the limit.\n"
        "Crashes: episodes that end with a collision or with a drone off the grid.\n"
        f"Lead of {name} over each baseline, in percentage points and in steps."
    )
    if folder is not None:
        save_csv(Path(folder) / "evaluation.csv", every)
        search.save(file := Path(folder) / "search.json")
        video = Path(folder) / "video.gif"
        record(policy, search, video, view=view, name=name)
        print(f"\n{video} shows the policy.")
        if isinstance(policy, str):
            print(f"To watch it: python -m DroneSwarmSearch play {file} --policy {policy}")
    return every
