"""The tasks of the benchmark, and their held-out searches."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from functools import partial
from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from DroneSwarmSearch._internal import checks
from DroneSwarmSearch._internal.arrays import Floats
from DroneSwarmSearch._internal.progress import progress as shown_progress
from DroneSwarmSearch.core.named_search import NamedSearch
from DroneSwarmSearch.core.rules import RewardScheme
from DroneSwarmSearch.core.scenario import Scenario
from DroneSwarmSearch.evaluation.episodes import Episodes
from DroneSwarmSearch.evaluation.results import Evaluation
from DroneSwarmSearch.evaluation.rollout import roll_out
from DroneSwarmSearch.evaluation.run import Case, evaluate
from DroneSwarmSearch.evaluation.stage import PolicyLike, copied, prepared
from DroneSwarmSearch.layouts.view import View
from DroneSwarmSearch.persons.hypotheses import Drift
from DroneSwarmSearch.persons.person import Person
from DroneSwarmSearch.policies import PlannerPolicy
from DroneSwarmSearch.policies.base import BatchPolicy
from DroneSwarmSearch.vector.engine import Sampler

SEED = 1_000_000  # of held-out episodes; training usually starts from small seeds
EPISODES = 500  # of a round
ROUNDS = 4  # for several persons

PRECISION = 0.001  # half of the 95% interval of the success, at which no further round is flown
MOST_ROUNDS = 40

PLANNING = 0.5  # seconds of work for a plan of the yardstick

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

The matrix is the posterior, so a policy needs no memory; the task takes minutes to learn. It is one
to try a trainer with, and not part of the benchmark.
"""


@dataclass(frozen=True)
class Task:
    """A task of the benchmark, which changes with the suite's version only.

    Attributes:
        parameters: those of `DroneSwarmSearch`.
        story: what it asks of a policy, in a sentence.
        sampler: draws what is new in every episode, as for `SearchBatch`; None if nothing is.
    """

    parameters: Mapping[str, Any]
    sampler: Sampler | None = None
    story: str = "A search to try a trainer with."

    @property
    def has_several_persons(self) -> bool:
        """Whether there are several persons, whose finds change what the drones know."""
        return len(Scenario(**self.parameters).persons_to_find) > 1

    @property
    def training(self) -> dict[str, Any]:
        """Parameters of a vector environment to train in, with the sampler.

        A search pays the mean of a reward for finding, given what is known, without its variance:
        with one person in the coverage mission, in which nobody is found, and else by
        `RewardScheme.expected(given_misses=True)`.
        """
        pays: dict[str, Any] = {"mission": "coverage"}
        if self.has_several_persons:
            pays = {"reward_scheme": RewardScheme.expected(given_misses=True)}
        return {**self.parameters, **pays, "sampler": self.sampler}

    def held_out(self) -> list[NamedSearch]:
        """The 500 searches to test on, or the only one.

        With one person they are coverage missions, in which a policy's success is exact.
        """
        rng = np.random.default_rng(SEED)
        draw = self.sampler or (lambda rng: {})
        drawn = [draw(rng) for _ in range(EPISODES if self.sampler else 1)]
        mission = "rescue" if self.has_several_persons else "coverage"
        given = [{**self.parameters, **new, "mission": mission} for new in drawn]
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
        rounds: int | None = None,
        progress: bool = True,
    ) -> Evaluation:
        """Evaluate a policy on the held-out searches, which are the same for everybody.

        The success is the mean over them, and with several persons the mean share of the persons
        that are found. A round is one episode of each search, 500 in all. With one person, a
        deterministic policy is exact after a round; others fly rounds, with the next seeds, until
        the 95% interval is the success +- 0.1 points. With several persons, all fly four rounds,
        and the interval accounts for the draws of episodes.

        Policies that read the persons of a scenario (`BatchPolicy.reads_persons`), such as
        "greedy-posterior", are made for each search. Of any other, one flies all episodes together,
        made from the `Scenario` of the first: it must not know more than it observes.

        Args:
            policy: as for `evaluation.evaluate`.
            view: what the policy sees and returns, as for `evaluate`.
            deterministic: whether its actions depend on nothing but what it has observed, as for
                `evaluate`.
            name: the policy's name in results.
            rounds: how many to fly, at least 1; without, as above. An exact figure needs one.
            progress: show a progress bar on a terminal, if tqdm is installed.

        Raises:
            TypeError: `policy` is an object that reads persons, or `rounds` is not an integer.
            ValueError: `rounds` is below 1.
        """
        if rounds is not None:
            rounds = checks.integer("rounds", rounds, 1)
        searches = self.held_out()
        first = searches[0]
        case = Case.of(policy, first, view, deterministic, name)
        persons = tuple(search.scenario.persons_to_find for search in searches)
        scenario = case.search.scenario.replace(persons=persons[0])
        combined = _SeveralSearches("held-out", first.reason, scenario, situations=persons)
        is_exact = case.is_exact and not self.has_several_persons
        result = partial(
            Evaluation,
            policy=case.spec.name,
            search=combined,
            seed=SEED,
            view=case.view,
            is_exact=is_exact,
            strata=len(searches),
        )
        if issubclass(case.spec.kind, BatchPolicy) and case.spec.kind.reads_persons:
            if isinstance(policy, BatchPolicy):
                raise TypeError(
                    "policy must be a name or a class, because one is made for each search, unless "
                    f"it states reads_persons = False; got an instance of {case.spec.kind.__name__}"
                )
            fly = partial(_round_of_each, case, searches, progress)
        else:
            fly = partial(_round, prepared(case.spec, first), combined, case.view)
        flown = [fly(0)]
        if is_exact:
            if deterministic:  # nobody else vouches for it
                flown[0].check_alike(fly(1))
            if len(searches) == 1:
                return result(episodes=flown[0].with_common_curve())
            return result(episodes=flown[0])
        most = rounds or (ROUNDS if self.has_several_persons else MOST_ROUNDS)
        with shown_progress(f"{case.spec.name}, rounds", most, progress) as bar:
            bar(1)
            while len(flown) < most:
                flown.append(fly(len(flown)))
                bar(len(flown))
                success = result(episodes=Episodes.joined(flown)).success
                if rounds is None and success.high - success.low <= 2.0 * PRECISION:
                    break
        return result(episodes=Episodes.joined(flown))

    def yardstick(self, searches: Sequence[int] = (), *, progress: bool = True) -> Floats:
        """The success of plans that know more than any policy, in held-out searches: float64, (n,).

        `planner` works half a second on each plan, and the success is exact. If several persons
        drift together, a plan knows by which hypothesis, drawn anew for each search, and its drones
        hear each other. The benchmark's score counts the mean over all searches as 100.

        Args:
            searches: their numbers; all by default.
            progress: show a progress bar on a terminal, if tqdm is installed.
        """
        held_out = self.held_out()
        numbers = searches or range(len(held_out))
        found = []
        with shown_progress("yardstick, searches", len(numbers), progress) as bar:
            for done, number in enumerate(numbers, 1):
                found.append(_planned(held_out[number], np.random.default_rng((SEED, number))))
                bar(done)
        return np.array(found)


@dataclass(frozen=True)
class _SeveralSearches(NamedSearch):
    """Searches that differ in their persons; the episodes take them in turn."""

    situations: tuple[tuple[Person, ...], ...] = ()

    @property
    def parameters(self) -> dict[str, Any]:
        which = np.arange(EPISODES) % len(self.situations)
        return {**super().parameters, "situations": self.situations, "situation": which}


def _planned(search: NamedSearch, rng: np.random.Generator) -> float:
    """What the plan of the yardstick finds in a search."""
    scenario = search.scenario
    if scenario.shared_drift:
        cases = scenario.by_hypothesis()
        weights = np.array([weight for weight, _ in cases])
        _, scenario = cases[rng.choice(len(cases), p=weights / weights.sum())]
        alike = scenario.persons_to_find[:1]
        scenario = scenario.replace(
            persons=alike, shared_drift=False, radio_range=None, mission="coverage"
        )
    known = NamedSearch(search.name, search.reason, scenario)
    planner = PlannerPolicy(scenario, seconds=PLANNING)
    return evaluate(planner, known, episodes=1, progress=False).success.value


def _round(policy: PolicyLike, search: _SeveralSearches, view: View, number: int) -> Episodes:
    """One episode of each of the held-out searches, or 500 of the only one."""
    first = SEED + number * EPISODES
    return _flown(copied(policy), search, range(first, first + EPISODES), view)


def _round_of_each(
    case: Case, searches: Sequence[NamedSearch], progress: bool, number: int
) -> Episodes:
    """`_round` of a policy that is made for each search."""
    first = SEED + number * EPISODES
    seeds = np.arange(first, first + EPISODES).reshape(-1, len(searches))
    flown = []
    with shown_progress(f"{case.spec.name}, searches", len(searches), progress) as bar:
        for index, search in enumerate(searches):
            policy = prepared(case.spec, search)
            flown.append(_flown(policy, search, seeds[:, index].tolist(), case.view))
            bar(index + 1)
    return Episodes.joined(flown)


def _flown(policy: PolicyLike, search: NamedSearch, seeds: Sequence[int], view: View) -> Episodes:
    """Episodes; with several persons, the curves are the share of them that has been found."""
    scenario = search.scenario
    is_one = len(scenario.persons_to_find) == 1
    episodes = roll_out(policy, search, seeds, view, wants_curves=is_one)
    if is_one:
        return episodes
    steps = np.arange(scenario.timestep_limit + 1)[:, None]
    found_at = episodes.found_at[:, None]
    shares = ((found_at > 0) & (found_at <= steps)).mean(axis=2)
    return replace(episodes, curves=shares)


# The samplers.


def _directions(angles: ArrayLike) -> Floats:
    """Unit vectors, (..., 2), rounded because libraries differ in the last digits of sines.

    So the held-out searches are the same on every machine.
    """
    directions: Floats = np.stack([np.cos(angles), np.sin(angles)], axis=-1)
    return directions.round(8)


def _turning(grid_size: int, limit: int, rng: np.random.Generator) -> dict[str, Any]:
    """Draw a person whom a fast current carries round a circle, four cells inside of the grid."""
    speed = 0.7
    period = rng.uniform(30.0, 60.0)
    radius = speed * period / (2.0 * np.pi)
    room = grid_size / 2.0 - radius - 4.0
    centre = (grid_size - 1) / 2.0 + rng.uniform(-room, room, 2)
    angle = rng.uniform(0.0, 2.0 * np.pi)
    side = rng.choice([-1.0, 1.0])
    start = centre + radius * _directions(angle)
    angles = angle + side * (np.pi / 2.0 + 2.0 * np.pi / period * np.arange(limit))
    current = speed * _directions(angles)
    drift = Drift(start, start_sd=3.0, vector=current, diffusion=0.05)
    return {"persons": [Person(drift, probability_of_detection=0.8)]}


def _wreck(grid_size: int, speed: float, adrift: int, rng: np.random.Generator) -> dict[str, Any]:
    """Draw a wreck in the middle third, whose six persons drift to one of eight sides, or stay."""
    start = rng.uniform(grid_size / 3.0, 2.0 * grid_size / 3.0, 2)
    angles = rng.uniform(0.0, 2.0 * np.pi) + np.arange(8) * np.pi / 4.0
    currents = [*(speed * _directions(angles)), np.zeros(2)]
    diffusion = 0.8 / adrift
    drifts = [
        Drift(start, start_sd=1.0, vector=current, diffusion=diffusion, adrift=adrift)
        for current in currents
    ]
    return {"persons": [Person(drifts, probability_of_detection=0.9)] * 6}


def _task(
    story: str, sampler: Sampler, grid_size: int, n_drones: int, timestep_limit: int, **more: Any
) -> Task:
    """A task whose parameters have the persons of some search, as many as the sampler draws."""
    parameters = {
        "grid_size": grid_size,
        "n_drones": n_drones,
        "timestep_limit": timestep_limit,
        "bayesian_update": True,
        "crash": "block",
        **more,
        **sampler(np.random.default_rng(0)),
    }
    return Task(parameters, sampler, story)


TASKS = {
    "drift": _task(
        "A fast current turns: fly where the person will be.",
        partial(_turning, 24, 50),
        grid_size=24,
        n_drones=3,
        timestep_limit=50,
    ),
    "wreck": _task(
        "Six persons drift alike, and nobody knows where to: one find shows where the others are.",
        partial(_wreck, 20, 0.4, 20),
        grid_size=20,
        n_drones=4,
        timestep_limit=40,
        shared_drift=True,
    ),
    "radio": _task(
        "Six persons drift alike. Drones hear of finds within four cells only.",
        partial(_wreck, 20, 0.4, 20),
        grid_size=20,
        n_drones=4,
        timestep_limit=40,
        shared_drift=True,
        radio_range=4,
    ),
    "fleet": _task(
        "Six persons drift alike on a larger sea. Twelve drones divide the work.",
        partial(_wreck, 28, 0.2, 50),
        grid_size=28,
        n_drones=12,
        timestep_limit=36,
        shared_drift=True,
    ),
}
"""The tasks by name.

"drift": one person in a fast current that turns. "wreck": six persons who drift together. "radio":
the same, with drones that hear each other within 4 cells. "fleet": the same on a larger sea, with
12 drones.
"""
