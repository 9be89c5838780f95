"""The comparison of a trained policy with baselines."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from functools import partial
from pathlib import Path
from typing import Any

from DroneSwarmSearch._internal.progress import progress
from DroneSwarmSearch._internal.text import plural
from DroneSwarmSearch.core.named_search import NamedSearch
from DroneSwarmSearch.core.rules import Ending
from DroneSwarmSearch.core.scenario import resolve_scenario
from DroneSwarmSearch.evaluation.recording import record
from DroneSwarmSearch.evaluation.results import Evaluation, compare, save_csv
from DroneSwarmSearch.evaluation.run import evaluate
from DroneSwarmSearch.evaluation.text_tables import figure, percent, print_table, signed
from DroneSwarmSearch.layouts.view import View
from DroneSwarmSearch.training.tasks import SEED, Task


def compare_with_baselines(
    policy: object,
    parameters: Mapping[str, Any] | Task,
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
        parameters: those of `DroneSwarmSearch`, and optionally "drones_positions"; or a task, in
            whose held-out searches `random` and `greedy-matrix` are the baselines.
        view: what the policy sees and returns, as for `evaluate`.
        episodes: number of episodes, at least 1; a task decides itself.
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
    protocol = _Protocol.of(parameters, baselines, name, episodes)
    print(f"Comparing {name} with {', '.join(protocol.baselines)}", flush=True)
    trained = protocol.judge(policy, view=view, name=name)
    every = [trained]
    with progress("comparison", len(protocol.baselines)) as on_progress:
        for number, baseline in enumerate(protocol.baselines, 1):
            every.append(protocol.judge(baseline))
            on_progress(number)
    _print_comparison(trained, every)
    print(
        f"\n{protocol.words}; 95% intervals in parentheses;\nsuccess and time without one are "
        "exact.\n"
        f"Success: {protocol.success} within the limit. Time: until then, or the limit.\n"
        "Crashes: episodes that end with a collision or with a drone off the grid.\n"
        f"Lead of {name} over each baseline, in percentage points and in steps."
    )
    if folder is not None:
        save_csv(Path(folder) / "evaluation.csv", every)
        file = Path(folder) / "search.json"
        protocol.search.save(file)
        video = Path(folder) / "video.gif"
        print(f"\nRecording an episode as {video}", flush=True)
        record(policy, protocol.search, video, view=view, name=name)
        print(f"{video} shows the policy.")
        if isinstance(policy, str):
            print(f"To watch it: python -m DroneSwarmSearch play {file} --policy {policy}")
    return every


@dataclass(frozen=True)
class _Protocol:
    """How policies are compared.

    Attributes:
        search: the search that a film shows.
        judge: evaluates a policy, with the arguments `view` and `name` of `evaluate`.
        baselines: names of policies of the package.
        words: what is evaluated.
        success: what counts as success.
    """

    search: NamedSearch
    judge: Callable[..., Evaluation]
    baselines: Sequence[str]
    words: str
    success: str = "all persons found"

    @classmethod
    def of(
        cls,
        parameters: Mapping[str, Any] | Task,
        baselines: Sequence[str],
        name: str,
        episodes: int,
    ) -> _Protocol:
        """From the arguments of `compare_with_baselines`."""
        if isinstance(parameters, Task):
            searches = parameters.held_out()
            words = f"Means over the {plural(len(searches), 'held-out search', 'es')}"
            names = ("random", "greedy-matrix")
            share = "the share of the persons found"
            success = share if parameters.has_several_persons else cls.success
            return cls(searches[0], parameters.evaluate, names, words, success)
        given = dict(parameters)
        drones = given.pop("drones_positions", ())
        reason = f"An episode that {name} has not trained on."
        search = NamedSearch("task", reason, resolve_scenario(**given), drones)
        judge = partial(evaluate, search=search, episodes=episodes, seed=SEED)
        words = f"{episodes:,} episodes, the same for all policies"
        return cls(search, judge, baselines, words)


def _print_comparison(trained: Evaluation, every: Sequence[Evaluation]) -> None:
    """Print a row for each policy, with the lead of the trained one."""
    rows = []
    for result in every:
        crashes = result.endings[Ending.COLLISION] + result.endings[Ending.LEFT_GRID]
        share = crashes / len(result.episodes)
        lead = ["", ""]
        if result is not trained:
            success = compare(trained, result).success.scaled(100.0)
            lead = [signed(success), signed(compare(result, trained).time)]
        figures = [percent(result.success), figure(result.time), f"{100 * share:.1f}"]
        rows.append([result.policy, *figures, *lead])
    headers = ["success, %", "time, steps", "crashes, %", "lead, points", "lead, steps"]
    print_table(["policy", *headers], rows, words=1)
