"""The policy "rollout": paths over the next steps, in which a find also counts what it teaches."""

from __future__ import annotations

import copy
from collections.abc import Sequence
from dataclasses import dataclass, field, replace
from typing import Any

import numpy as np

from DroneSwarmSearch._internal.arrays import Floats, Singles
from DroneSwarmSearch._internal.cells import cell_number
from DroneSwarmSearch.core.grid import Cell, Grid
from DroneSwarmSearch.core.scenario import Scenario
from DroneSwarmSearch.drift.model import DriftModel
from DroneSwarmSearch.paths.best_paths import DronePath, cells_looked_at, path_beside_others
from DroneSwarmSearch.policies.base import SwarmPolicy
from DroneSwarmSearch.policies.belief_tracker import BeliefTracker
from DroneSwarmSearch.policies.open_loop import PlanStep, steps_of

AHEAD = 30
"""Steps to look ahead: with half or twice as many, drones find no more of a wreck."""

KEPT = 5
"""Steps for which drones follow their paths before they look ahead again."""

TEACHES = 10.0
"""What a find at the start, of an unlikely hypothesis, is worth for each other missing person."""


@dataclass
class _Kind:
    """Missing persons about whom the same is known.

    Attributes:
        model: how they drift.
        count: how many they are.
        worth: of a search that meets one of them, in each of the next steps: (steps,).
        mass: where one of them is: (M, R, N).
        detection: the probability that a search of a person's cell finds the person.
    """

    model: DriftModel
    count: int
    worth: Floats
    mass: Floats
    detection: float


@dataclass
class _RolloutMemory:
    """The beliefs, and the paths that the drones follow, from some step on."""

    tracker: BeliefTracker
    plan: list[PlanStep] = field(default_factory=list)
    first: int = 0
    missing: tuple[int, ...] = ()

    def __deepcopy__(self, memo: dict[int, Any]) -> _RolloutMemory:
        return replace(self, tracker=copy.deepcopy(self.tracker, memo))


class RolloutPolicy(SwarmPolicy):
    """Looks ahead along all paths of the next steps, and counts what a find teaches.

    The policy tracks the posterior itself. Drones choose in turn: each takes the path of the next
    `AHEAD` steps that gains most, by dynamic programming, given the searches of those before it.
    What a search gains is the number of persons whom it is expected to find. If persons drift
    together (`Scenario.shared_drift`), the first find under hypothesis k also counts what it
    teaches: ``TEACHES`` x (1 - p_k) x the other missing persons x the share of the time that is
    left, where p_k is how likely k is already. So drones look for anybody soon, in directions that
    are not known to be wrong; greedy search stays where most persons may be.

    After ``KEPT`` steps, a find, or a displacement, the drones look ahead again. With a
    `radio_range`, each drone plans for itself and for those in range, from what it knows.

    For a decision, this is a rollout of every path instead of a few: until the first find, what
    drones learn does not depend on where the persons are, so all possible worlds are simulated at
    once (D. P. Bertsekas, Rollout, Policy Iteration, and Distributed Reinforcement Learning, 2020).
    """

    def __init__(self, scenario: Scenario) -> None:
        super().__init__(scenario)
        self._tracker = BeliefTracker(scenario)
        self._grid = Grid.of(scenario.grid_size)
        self._teaches = scenario.shared_drift and scenario.mission == "rescue"

    def begin(self) -> _RolloutMemory:
        return _RolloutMemory(copy.deepcopy(self._tracker))

    def learn(self, memory: _RolloutMemory, searched: list[int], actions: list[int]) -> None:
        memory.tracker.learn(searched, actions)

    def choose(self, memory: _RolloutMemory, cells: list[Cell], matrix: Singles) -> Sequence[int]:
        tracker = memory.tracker
        tracker.observe(matrix)
        now = tracker.step - memory.first
        is_current = now < min(KEPT, len(memory.plan)) and memory.missing == tracker.missing
        if not is_current or memory.plan[now][0] != cells:
            memory.plan = self._looked_ahead(tracker, cells)
            memory.first = tracker.step
            memory.missing = tracker.missing
            now = 0
        return memory.plan[now][1]

    def _looked_ahead(self, tracker: BeliefTracker, cells: list[Cell]) -> list[PlanStep]:
        """The drones' cells and actions in the next steps."""
        steps = max(min(AHEAD, self.scenario.timestep_limit - tracker.step), 1)
        kinds = self._kinds(tracker, steps)
        starts = [cell_number(x, y, self.scenario.grid_size) for x, y in cells]
        paths: list[DronePath] = []
        for number, start in enumerate(starts):
            gains = self._gains(tracker, kinds, paths, steps)
            path = path_beside_others(
                gains,
                start,
                before=paths,
                waiting=starts[number + 1 :],
                crash=self.scenario.crash,
                in_flight=self.scenario.search_in_flight,
            )
            paths.append(path)
        return steps_of(paths, self._grid)

    def _kinds(self, tracker: BeliefTracker, steps: int) -> list[_Kind]:
        """The missing persons, those about whom the same is known together."""
        kinds: dict[tuple[Any, ...], _Kind] = {}
        persons = self.scenario.persons_to_find
        for person in tracker.missing:
            detection = self.scenario.detections[person]
            model = tracker.forecasts[person]
            key = model.key, detection, persons[person].survival
            if key in kinds:
                kinds[key].count += 1
                continue
            ahead = range(tracker.step, tracker.step + steps)
            worth = np.array([tracker.worth(person, step) for step in ahead])
            kinds[key] = _Kind(model, 1, worth, tracker.weighed(person), detection)
        return [*kinds.values()]

    def _gains(
        self,
        tracker: BeliefTracker,
        kinds: Sequence[_Kind],
        paths: Sequence[DronePath],
        steps: int,
    ) -> Floats:
        """What one more search of each cell gains in each step, beside paths: (steps, N, N)."""
        size = self.scenario.grid_size
        looked_at = [cells_looked_at(path.cells, self.scenario.search_in_flight) for path in paths]
        masses = [kind.mass for kind in kinds]
        likely = masses[0].sum(axis=(1, 2))  # each hypothesis, if they are shared
        gains = np.zeros((steps, size, size))
        for step in range(steps):
            searched = [
                int(cells[step])
                for cells, path in zip(looked_at, paths, strict=True)
                if path.searches[step]
            ]
            masses = [
                _missed(kind, mass, searched) for kind, mass in zip(kinds, masses, strict=True)
            ]
            lessons = self._lessons(tracker.step + step, kinds, masses, likely)
            for kind, mass, lesson in zip(kinds, masses, lessons, strict=True):
                weighed = mass * (1.0 + lesson)[:, None, None]
                gains[step] += kind.count * kind.worth[step] * kind.model.map(weighed)
            if step < steps - 1:
                masses = [
                    kind.model.forward(mass, tracker.step + step)
                    for kind, mass in zip(kinds, masses, strict=True)
                ]
        return gains

    def _lessons(
        self, step: int, kinds: Sequence[_Kind], masses: Sequence[Floats], likely: Floats
    ) -> list[Floats]:
        """What a find of each kind of person teaches under each hypothesis, in finds: (M,) each.

        Only the first find teaches, so this falls with the probability that there has been one.
        """
        others = sum(kind.count for kind in kinds) - 1
        if not self._teaches or not others:
            return [np.zeros(len(mass)) for mass in masses]
        left = max(self.scenario.timestep_limit - step - 1, 0) / self.scenario.timestep_limit
        known = np.where(likely > 0.0, likely, 1.0)
        unfound = [np.minimum(mass.sum(axis=(1, 2)) / known, 1.0) for mass in masses]
        nobody = np.ones(len(likely))  # the probability that nobody has been found
        for kind, share in zip(kinds, unfound, strict=True):
            nobody *= share**kind.count
        value = TEACHES * (1.0 - likely) * others * left * nobody
        return [value / np.where(share > 0.0, share, 1.0) for share in unfound]


def _missed(kind: _Kind, mass: Floats, cells: Sequence[int]) -> Floats:
    """What searches of some cells leave of the mass."""
    if not cells:
        return mass
    left = mass.copy()
    flat = left.reshape(-1)
    for cell in cells:
        flat[kind.model.states(cell)] *= 1.0 - kind.detection
    return left
