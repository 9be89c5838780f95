"""The world state: persons adrift, searches for them, and what is known about them.

Persons walk only when a search or a picture needs their cells. Every draw belongs to an episode, a
step and a person, so it does not matter when draws are made, or how many at a time.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np

from DroneSwarmSearch._internal.arrays import Flags, Singles
from DroneSwarmSearch._internal.streams import Streams
from DroneSwarmSearch.core.knowledge import Knowledge
from DroneSwarmSearch.core.rules import COVERED_AT
from DroneSwarmSearch.core.scenario import Scenario
from DroneSwarmSearch.drift.shared import draws_given

_FEWEST_AHEAD = 8
_MOST_AHEAD = 32
"""The steps that persons walk at a time, because each call has a fixed cost."""


def _for_users(matrix: Singles) -> Singles:
    """A read-only copy of a matrix; what users do to it cannot change the episode."""
    copy = matrix.copy()
    copy.setflags(write=False)
    return copy


class WorldState:
    """The persons of a search and what is known about them, in one episode after another.

    Attributes:
        persons: all persons, by number.
        missing: the persons not yet found.
        finds: for every person found, the drone that found them, and the cell.
        step: completed steps.
        success: the cumulative probability of success (POS) of all searches so far, or None.
        known: what all drones together know.
        known_by: what each drone knows; drones that have heard the same share it. Empty if all
            drones always hear each other.
        matrix: the matrix of all drones together, read-only.
        matrices: the matrix that each drone observes, read-only.
        is_rescue: whether the mission is to find the persons; else nobody is found.
    """

    def __init__(self, scenario: Scenario) -> None:
        self._models = scenario.forecasts()
        self._detections = scenario.detections
        self._shared_weights = scenario.shared_weights
        self._scheme = scenario.reward_scheme
        self.is_rescue = scenario.mission == "rescue"
        self.persons = tuple(range(len(self._models)))
        self._n_drones = scenario.n_drones
        self.known = Knowledge(scenario, self._models, scenario.keeps_beliefs)
        self._has_radios = scenario.radio_range is not None
        self.known_by: list[Knowledge] = []

    def start(self, streams: Streams, episode: int) -> None:
        """Start the episode with this number since the seed."""
        self._streams = streams
        self._episode = episode
        self.finds: dict[int, tuple[int, int]] = {}
        self._paths: list[list[int]] = []  # each person's states over some steps
        self._paths_first = 0  # the first of these steps
        self._forget_step()
        self.known.start()
        self.step = 0
        self.missing = self.persons
        self.success = self.known.success
        if self._has_radios:
            self.known_by = [self.known] * self._n_drones
        self._show()

    def _forget_step(self) -> None:
        """Forget the last step: its searches, by cell, its finds, by drone, what was known."""
        self._searches: Mapping[int, Sequence[int]] = {}
        self._found_by: dict[int, dict[int, int]] = {}
        self._known_before = self.known

    @property
    def is_covered(self) -> bool:
        """Whether a coverage mission is complete."""
        return not self.is_rescue and self.success is not None and self.success > COVERED_AT

    def _show(self) -> None:
        """Make the matrices of a step."""
        self._matrix = self.known.matrix()
        self.matrix = _for_users(self._matrix)
        self.matrices = [self.matrix] * self._n_drones
        if self.known_by:
            shown = {id(self.known): self.matrix}
            for knowledge in self.known_by:
                if id(knowledge) not in shown:
                    shown[id(knowledge)] = _for_users(knowledge.matrix())
            self.matrices = [shown[id(knowledge)] for knowledge in self.known_by]

    # Time.

    def advance(self, heard: Flags | None = None) -> None:
        """Complete a step: the drones tell each other what they did, and all drifts.

        Args:
            heard: which drone hears which, see `radio.hearing`; None if all hear each other.
        """
        self.step += 1
        if heard is None:
            self.known.advance()
        else:
            self._tell(heard)
            for knowledge in {id(each): each for each in (self.known, *self.known_by)}.values():
                knowledge.advance()
        self._show()

    def _tell(self, heard: Flags) -> None:
        """Let each drone learn of the searches and finds of this step that it hears."""
        searches = [(cell, drone) for cell, drones in self._searches.items() for drone in drones]
        if not searches:
            return
        after: dict[tuple[int, tuple[int, ...]], Knowledge] = {}  # by what was known, and heard
        everybody = tuple(drone for _, drone in searches)
        for number, listener in enumerate(heard.tolist()):
            before = self.known_by[number]
            told_by = tuple(drone for drone in everybody if listener[drone])
            if before is self.known:
                if told_by == everybody:
                    continue
                before = self._known_before
            key = id(before), told_by
            if key not in after:
                after[key] = self._told(before, searches, told_by)
            self.known_by[number] = after[key]
        self._forget_step()

    def _told(
        self, before: Knowledge, searches: Sequence[tuple[int, int]], told_by: Sequence[int]
    ) -> Knowledge:
        """What is known after hearing of the searches, (cell, drone), and finds of some drones."""
        cells = [cell for cell, drone in searches if drone in told_by]
        found = {
            person: cell
            for drone, persons in self._found_by.items()
            if drone in told_by
            for person, cell in persons.items()
        }
        if not cells:
            return before
        knowledge = before.copy()
        knowledge.update(cells, found)
        return knowledge

    # The persons.

    def person_cell(self, person: int) -> int:
        """A person's current cell, y * N + x."""
        if not self._paths:
            draws = self._start_draws()
            models = zip(self._models, draws, strict=True)
            self._paths = [[int(model.start(draw))] for model, draw in models]
        while self.step >= self._paths_first + len(self._paths[0]):
            self._walk()
        return int(self._models[person].cells(self._paths[person][self.step - self._paths_first]))

    def _start_draws(self) -> Any:
        """A uniform draw for the start of each person; after them comes that of a hypothesis."""
        n = len(self.persons)
        if self._shared_weights is None:
            return self._streams.start.between(self._episode, 0, n)
        *draws, hypothesis = self._streams.start.between(self._episode, 0, n + 1)
        return draws_given(np.array(hypothesis), np.array(draws), self._shared_weights)

    def _walk(self) -> None:
        """Let all persons walk some steps."""
        n = len(self._models)
        known = self._paths_first + len(self._paths[0]) - 1
        steps = min(max(_FEWEST_AHEAD, known), _MOST_AHEAD)
        first = 2 * n * known
        last = 2 * n * (known + steps)
        draws = self._streams.drift.between(self._episode, first, last)
        self._paths = [
            model.walk(path[-1], known, draws[2 * k :: 2 * n], draws[2 * k + 1 :: 2 * n])
            for k, (model, path) in enumerate(zip(self._models, self._paths, strict=True))
        ]
        self._paths_first = known + 1

    # Searches.

    def search(self, searches: Mapping[int, Sequence[int]]) -> set[int]:
        """Let drones, given by cell, search, and update what is known; returns the finders."""
        found: dict[int, int] = {}
        found_by: dict[int, dict[int, int]] = {}
        can_be_found = self.missing if self.is_rescue else ()
        for person in can_be_found:
            cell = self.person_cell(person)
            finder = self._finder(person, searches[cell]) if cell in searches else None
            if finder is not None:
                self.finds[person] = finder, cell
                found[person] = cell
                found_by.setdefault(finder, {})[person] = cell
        self._searches = searches
        self._found_by = found_by
        if self._has_radios:
            self._known_before = self.known.copy()
        cells = [cell for cell, drones in searches.items() for _ in drones]
        self.known.update(cells, found)
        self.missing = self.known.missing
        self.success = self.known.success
        return set(found_by)

    def _finder(self, person: int, drones: Sequence[int]) -> int | None:
        """The first of the drones that search the person's cell who finds the person; or None."""
        detection = self._detections[person]
        if detection == 1.0:
            return drones[0]
        if detection == 0.0:
            return None
        index = self.step * len(self.persons) + person
        [draw] = self._streams.detection.between(self._episode, index, index + 1)
        found = detection  # the probability that drones so far find the person
        for drone in drones:
            if draw < found:
                return drone
            found = found + (1.0 - found) * detection
        return None

    def observed(self, searches: Mapping[int, Sequence[int]]) -> dict[int, float]:
        """What each search pays for, by drone, before `search`.

        The matrix's value for the cell; or, with `RewardScheme.expected_finds`, the added success
        or the expected share found, times the probability that the person is alive.
        """
        cells = [*searches]
        if self._scheme.given_misses:
            values = dict(zip(cells, self.known.expected_share(cells).tolist(), strict=True))
        elif self._scheme.expected_finds:
            values = dict(zip(cells, self.known.added_success(cells).tolist(), strict=True))
        else:
            values = {cell: self._matrix.item(cell) for cell in cells}
        return {drone: values[cell] for cell, drones in searches.items() for drone in drones}
