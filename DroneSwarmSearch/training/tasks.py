"""The tasks of the benchmark, and their held-out searches."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from functools import partial
from typing import Any

import numpy as np

from DroneSwarmSearch._internal.progress import progress as shown_progress
from DroneSwarmSearch.core.named_search import NamedSearch
from DroneSwarmSearch.core.scenario import Scenario
from DroneSwarmSearch.evaluation.episodes import Episodes
from DroneSwarmSearch.evaluation.results import Evaluation
from DroneSwarmSearch.evaluation.rollout import roll_out
from DroneSwarmSearch.evaluation.run import Case
from DroneSwarmSearch.evaluation.stage import PolicyLike, copied, prepared
from DroneSwarmSearch.layouts.view import View
from DroneSwarmSearch.persons.person import Person
from DroneSwarmSearch.vector.engine import Sampler

SEED = 1_000_000  # of held-out episodes; training usually starts from small seeds
EPISODES = 500  # of a round

PRECISION = 0.001  # half of the 95% interval of the success, at which no further round is flown
MOST_ROUNDS = 40

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


@dataclass(frozen=True)
class Task:
    """A task of the benchmark, which changes with the suite's version only.

    Attributes:
        parameters: those of `DroneSwarmSearch`.
        sampler: draws what is new in every episode, as for `SearchBatch`; None if nothing is.
    """

    parameters: Mapping[str, Any]
    sampler: Sampler | None = None

    def held_out(self) -> list[NamedSearch]:
        """The 500 searches to test on, or the only one, as coverage missions."""
        rng = np.random.default_rng(SEED)
        draw = self.sampler or (lambda rng: {})
        drawn = [draw(rng) for _ in range(EPISODES if self.sampler else 1)]
        given = [{**self.parameters, **new, "mission": "coverage"} for new in drawn]
        reason = "No policy has trained on it."
        return [
            NamedSearch(f"held-out-{n}", reason, Scenario(**one)) for n, one in enumerate(given)
        ]

    def evaluate(
        self,
        policy: object,
        *,
        view: View | str | None = None,
        deterministic: bool | None = None,
        name: str | None = None,
        progress: bool = True,
    ) -> Evaluation:
        """Evaluate a policy on the held-out searches, which are the same for everybody.

        The success is the mean over them. That of a deterministic policy is exact after one round
        of 500 episodes, one of each search. Others fly more rounds, with the next seeds, until the
        95% interval is the success +- 0.1 points; it accounts for the actions that they draw.

        One policy flies all episodes together, made from the `Scenario` of the first: it must not
        know more of the person than it observes. Evaluate others, such as the planner, in every
        search of `held_out`.

        Args:
            policy: as for `evaluation.evaluate`.
            view: what the policy sees and returns, as for `evaluate`.
            deterministic: whether its actions depend on nothing but what it has observed, as for
                `evaluate`.
            name: the policy's name in results.
            progress: show a progress bar on a terminal, if tqdm is installed.
        """
        first, *_ = searches = self.held_out()
        case = Case.of(policy, first, view, deterministic, name)
        persons = tuple(search.scenario.persons_to_find for search in searches)
        scenario = case.search.scenario.replace(persons=persons[0])
        combined = _SeveralSearches("held-out", first.reason, scenario, situations=persons)
        made = prepared(case.spec, first)
        flown = [_round(made, combined, 0, case.view)]
        result = partial(
            Evaluation,
            policy=case.spec.name,
            search=combined,
            seed=SEED,
            view=case.view,
            is_exact=case.is_exact,
            strata=len(searches),
        )
        if case.is_exact and len(searches) == 1:
            return result(episodes=flown[0].with_common_curve())
        if case.is_exact:
            if deterministic:  # nobody else vouches for it
                again = _round(made, combined, 1, case.view)
                flown[0].check_alike(again)
            return result(episodes=flown[0])
        with shown_progress(f"{case.spec.name}, rounds", MOST_ROUNDS, progress) as bar:
            while len(flown) < MOST_ROUNDS:
                flown.append(_round(made, combined, len(flown), case.view))
                bar(len(flown))
                success = result(episodes=Episodes.joined(flown)).success
                if success.high - success.low <= 2.0 * PRECISION:
                    break
        return result(episodes=Episodes.joined(flown))


@dataclass(frozen=True)
class _SeveralSearches(NamedSearch):
    """Searches that differ in their persons; the episodes take them in turn."""

    situations: tuple[tuple[Person, ...], ...] = ()

    @property
    def parameters(self) -> dict[str, Any]:
        which = np.arange(EPISODES) % len(self.situations)
        return {**super().parameters, "situations": self.situations, "situation": which}


def _round(policy: PolicyLike, search: _SeveralSearches, number: int, view: View) -> Episodes:
    """One episode of each of the held-out searches, or 500 of the only one."""
    first = SEED + number * EPISODES
    return roll_out(copied(policy), search, range(first, first + EPISODES), view)


def _any_drift(grid_size: int, rng: np.random.Generator) -> dict[str, Any]:
    """Draw the start, a sixth of the grid or more from its border, and a drift."""
    start = rng.integers(grid_size // 6, grid_size - grid_size // 6, 2)
    return {"person_initial_position": start, "vector": rng.uniform(-0.3, 0.3, 2)}


def _task(grid_size: int, n_drones: int) -> Task:
    size = {"grid_size": grid_size, "n_drones": n_drones}
    more = {"timestep_limit": 60, "bayesian_update": True}
    return Task({**size, **more}, partial(_any_drift, grid_size))


TASKS = {"small": Task(TRAINING_TASK), "medium": _task(20, 4), "large": _task(30, 12)}
"""The tasks by name, for 2, 4 and 12 drones; in the small one, start and drift are always alike."""
