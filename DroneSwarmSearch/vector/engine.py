"""The batch: many searches stepped together, arrays in and arrays out.

A step goes through the four phases of the single environment, for all rows at once:

1. all drones move or search, given the state they were shown;
2. the rules decide rewards and endings;
3. the clock advances: the persons and the beliefs drift;
4. the new state can be read: positions, matrices, or indices into the table of matrices.

A row whose episode has ended begins its next one in place of the following step, or earlier
in `restart`.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from DroneSwarmSearch._internal import checks
from DroneSwarmSearch._internal.arrays import Flags, Floats, Ints, Singles, Words
from DroneSwarmSearch._internal.errors import ResetNeeded
from DroneSwarmSearch._internal.signatures import shows_keywords_of
from DroneSwarmSearch._internal.streams import GOLDEN, mixed, numbers, stream_keys
from DroneSwarmSearch.actions import checked_actions
from DroneSwarmSearch.drift.persons import Person
from DroneSwarmSearch.frame import Frame
from DroneSwarmSearch.grid import grid_of
from DroneSwarmSearch.observations import batch_state_planes
from DroneSwarmSearch.rules import Action, Ending
from DroneSwarmSearch.scenario import REPLACED, Scenario, is_default, resolve_scenario
from DroneSwarmSearch.vector.catalogue import Catalogue, scenarios_of
from DroneSwarmSearch.vector.drones import BatchDrones
from DroneSwarmSearch.vector.world import BatchState

__all__ = ["Sampler", "SearchBatch"]

Situations = Sequence[Sequence[Person] | Person]

Sampler = Callable[[np.random.Generator], Mapping[str, Any]]
"""Draws a search (domain randomisation): returns what differs from the batch's scenario.

Any of `vector`, `person_initial_position`, `disperse_constant` and `probability_of_detection`, or
`persons` in place of these; and `drones_positions`. For example, random drift and start::

    def sampler(rng):
        return {
            "vector": rng.uniform(-0.5, 0.5, 2),
            "person_initial_position": rng.integers(5, 15, 2),
        }
"""

_SAMPLED = (*REPLACED, "persons", "drones_positions")

_CATALOGUE_SIZE = 256
"""The searches that a sampler draws at a time."""

_USES = 4
"""The episodes for each of them, on average, until others are drawn."""

_DRONE_BYTES = 64
"""A lower limit of the memory of each drone in each row."""

_FIRST = np.zeros(1, np.uint64)


@shows_keywords_of(Scenario)
class SearchBatch:
    """Many independent searches with the rules, forecasts and random numbers of one.

    Given the same seed and actions, each row reproduces `DroneSwarmSearch` bit for bit.

    Args:
        num_rows: the number of searches, E.
        scenario: the parameters of the searches; or pass them as keywords instead.
        situations: a catalogue in place of the scenario's persons: a sequence of situations, each
            a sequence of `Person`, the same number in each. Every episode draws one of them with
            equal chances.
        situation: the number of a situation, from 0, for every episode, in place of the draw;
            or one for each row, (E,).
        drones_positions: a cell (x, y) for each drone at the start of every episode, shape
            (n_drones, 2) or (E, n_drones, 2). By default drones stand from left to right
            from (0, 0), row by row.
        sampler: draws a catalogue of 256 searches, and a new one after every 1,024 episodes, see
            `Sampler`.
        wants_table: keep the matrices of all forecasts and steps in one table.
        finds_last: False simulates searches that never find a search's last missing person,
            although they may find the others.
        rows_name: the name of `num_rows` in error messages.

    Attributes:
        num_rows: the number of searches.

    Raises:
        TypeError: an argument is of the wrong type.
        ValueError: an argument is out of its limits, or given together with a scenario.
    """

    def __init__(
        self,
        num_rows: int,
        scenario: Scenario | None = None,
        *,
        situations: Situations | None = None,
        situation: ArrayLike | None = None,
        drones_positions: ArrayLike | None = None,
        sampler: Sampler | None = None,
        wants_table: bool = False,
        finds_last: bool = True,
        rows_name: str = "num_rows",
        **parameters: Any,
    ) -> None:
        self.num_rows = rows = checks.integer(rows_name, num_rows, 1)
        checks.boolean("wants_table", wants_table)
        checks.boolean("finds_last", finds_last)
        if sampler is not None and not callable(sampler):
            raise TypeError(f"sampler must be callable, or None, got {sampler!r}")
        if sampler is not None and situations is not None:
            raise ValueError("sampler cannot be given together with situations")
        self._scenario = scenario = resolve_scenario(scenario, **parameters)
        scenarios = [scenario]
        if situations is not None:
            for name in (*REPLACED, "persons"):
                if not is_default(name, value := getattr(scenario, name)):
                    raise ValueError(
                        f"{name} cannot be given together with situations, got {value!r}; "
                        "each Person has its own"
                    )
            scenarios = scenarios_of(scenario, situations)
        n = scenario.n_drones
        checks.fits("the drones", _DRONE_BYTES * rows * n, **{rows_name: rows}, n_drones=n)
        beliefs = max(sum(len(person.weights) for person in each.situation) for each in scenarios)
        needed = 8 * scenario.grid_size**2 * rows * beliefs * scenario.keeps_beliefs
        size = scenario.grid_size
        checks.fits("the persons' beliefs", needed, **{rows_name: rows}, grid_size=size)

        self._sampler = sampler
        self._rng = np.random.default_rng()  # of the sampler
        self._unused = 0  # episodes until the sampler draws other searches
        self._has_catalogue = situations is not None
        self._choices = len(scenarios)  # the searches that episodes draw from
        self._situation = self._checked_situation(situation, self._choices, self._has_catalogue)
        self._cells: Ints = np.tile(np.arange(n), (rows, 1))
        if drones_positions is not None:
            self._cells = scenario.drone_cells_of_rows(drones_positions, rows)
        self._sampled_cells: Ints | None = None  # (searches, n_drones)

        self._rows = np.arange(rows)
        self._counters: Words = np.zeros((4, rows), np.uint64)  # stream keys plus episodes
        self._seeded = np.zeros(rows, np.bool_)
        self._changing = False  # stays True after an interrupted step or reset
        self._drones = BatchDrones(scenario, rows)
        catalogue = Catalogue(scenarios, complete=wants_table)
        self._world = BatchState(catalogue, rows, finds_last)
        first = np.zeros_like(self._rows) if self._situation is None else self._situation
        self._world.begin(self._rows, self._counters, first)

    def _checked_situation(
        self, value: ArrayLike | None, choices: int, has_catalogue: bool
    ) -> Ints | None:
        if value is None:
            return None
        if not has_catalogue:
            raise ValueError(
                f"situation must be given together with situations, got {value!r} without them"
            )
        return checks.integers("situation", value, self.num_rows, 0, choices - 1)

    def _check_complete(self, what: str) -> None:
        if self._changing:
            raise ResetNeeded(f"{what}: a step or reset was interrupted; reset all searches first")

    # Episodes.

    def reset(
        self,
        seeds: Sequence[int | None] | None = None,
        rows: Ints | None = None,
        *,
        situations: Situations | None = None,
        situation: ArrayLike | None = None,
        drones_positions: ArrayLike | None = None,
    ) -> None:
        """Begin episodes.

        Args:
            seeds: one for each of these rows. A row with None continues its sequence of
                episodes, or starts one from system entropy. The seed of row 0 also seeds the
                sampler.
            rows: their numbers; all rows by default.
            situations: replace the catalogue, for these episodes and all later ones. Episodes
                under way keep their persons. Not with a sampler.
            situation: for these episodes only, as in the constructor.
            drones_positions: for these episodes only, as in the constructor.

        Raises:
            ResetNeeded: a step or reset was interrupted, and `rows` are not all rows.
            TypeError: a value is of the wrong type.
            ValueError: a value is out of its limits.
        """
        rows = self._rows if rows is None else checks.row_numbers(rows, self.num_rows)
        if self._changing and len(rows) < self.num_rows:
            raise ResetNeeded("reset: a step or reset was interrupted; reset all searches")
        counters = self._counters[:, rows] + GOLDEN
        if seeds is not None:
            seeds = checks.seeds("seeds", seeds)
            if len(seeds) != len(rows):
                raise ValueError(f"seeds must be {len(rows)}, one for each row, got {len(seeds)}")
        rng, due = self._rng, self._unused <= 0  # of the sampler
        for index, row in enumerate(rows.tolist()):
            seed = None if seeds is None else seeds[index]
            if seed is not None or not self._seeded[row]:
                counters[:, index] = stream_keys(seed) + GOLDEN
            if seed is not None and row == 0:
                rng, due = np.random.default_rng(seed), True
        catalogue, choices = None, self._choices
        if situations is not None:
            if self._sampler is not None:
                raise ValueError("situations cannot be given together with a sampler")
            persons = len(self._world.missing)
            scenarios = scenarios_of(self._scenario, situations, persons)
            catalogue, choices = self._world.extended(scenarios, rows), len(scenarios)
        has_catalogue = self._has_catalogue or situations is not None
        chosen = self._checked_situation(situation, choices, has_catalogue)
        self._checked_situation(self._situation, choices, has_catalogue)
        cells = None
        if drones_positions is not None:
            cells = self._scenario.drone_cells_of_rows(drones_positions, self.num_rows)[rows]
        sampled = self._sampled(rows, rng) if due else None

        # The input is valid: from here on the batch changes.
        self._changing = True
        self._rng = rng
        if catalogue is not None:
            self._world.use(catalogue, rows)
            self._choices, self._has_catalogue = choices, True
        self._begin(rows, counters, sampled, None if chosen is None else chosen[rows], cells)
        self._drones.forget(rows)
        self._changing = False

    def restart(self, rows: Ints) -> None:
        """Begin the next episodes of some rows, but keep their last rewards and endings.

        Raises:
            ResetNeeded: before the first `reset`, or after an interrupted step or reset.
            TypeError: the rows are not integers.
            ValueError: there is no such row.
        """
        rows = checks.row_numbers(rows, self.num_rows)
        self._check_complete("restart")
        if not self._seeded[rows].all():
            raise ResetNeeded("restart: not all rows have begun; call reset() first")
        sampled = self._sampled(rows, self._rng) if self._unused <= 0 else None
        self._changing = True
        self._begin(rows, self._counters[:, rows] + GOLDEN, sampled)
        self._changing = False

    def _sampled(
        self, starting: Ints, rng: np.random.Generator
    ) -> tuple[Catalogue, Ints | None] | None:
        """New searches from the sampler, if there is one, and their drones' cells.

        Raises:
            TypeError: the sampler returns something of the wrong type.
            ValueError: it returns values out of their limits.
        """
        if self._sampler is None:
            return None
        scenarios, cells = [], []
        for _ in range(_CATALOGUE_SIZE):
            drawn = self._sampler(rng)
            if not isinstance(drawn, Mapping):
                raise TypeError(f"sampler must return a mapping, got {drawn!r}")
            for name in drawn:
                if name not in _SAMPLED:
                    raise ValueError(
                        f"sampler must return parameters among {', '.join(_SAMPLED)}, got {name!r}"
                    )
            changes = {**drawn}
            if (positions := changes.pop("drones_positions", None)) is not None:
                cells.append(self._scenario.drone_cells(positions))
            scenarios.append(self._scenario.replace(**changes))
            if len(scenarios[-1].situation) != len(self._world.missing):
                raise ValueError(
                    f"sampler must return {len(self._world.missing)} persons, got {drawn!r}"
                )
        if cells and len(cells) < len(scenarios):
            raise ValueError("sampler must return drones_positions for every search, or for none")
        catalogue = self._world.extended(scenarios, starting)
        return catalogue, np.array(cells) if cells else None

    def _begin(
        self,
        rows: Ints,
        counters: Words,
        sampled: tuple[Catalogue, Ints | None] | None,
        situation: Ints | None = None,
        cells: Ints | None = None,
    ) -> None:
        """Begin the episodes of some rows, in all but rewards and endings.

        Args:
            rows: their numbers.
            counters: the counters of their random streams: uint64, (4, n).
            sampled: see `_sampled`.
            situation: the number of each row's search; by default, the usual one.
            cells: each row's drones' start cells; by default, the usual ones.
        """
        if sampled is not None:
            catalogue, self._sampled_cells = sampled
            self._world.use(catalogue, rows)
            self._choices, self._unused = _CATALOGUE_SIZE, _CATALOGUE_SIZE * _USES
        self._unused -= len(rows)
        self._counters[:, rows] = counters
        self._seeded[rows] = True
        keys = mixed(counters)
        if situation is None:
            if self._situation is not None:
                situation = self._situation[rows]
            elif self._choices == 1:
                situation = np.zeros_like(rows)
            else:
                situation = (numbers(keys[2], _FIRST) * self._choices).astype(np.int64)
        if cells is None:
            by_search = self._sampled_cells
            cells = self._cells[rows] if by_search is None else by_search[situation]
        self._world.begin(rows, keys, situation)
        self._drones.begin(rows, cells)

    @property
    def ready(self) -> bool:
        """Whether every row has begun an episode."""
        return bool(self._seeded.all())

    # A step.

    def step(
        self, actions: ArrayLike, matrices: Singles | None = None, *, autoreset: bool = True
    ) -> None:
        """Let every drone act once; rows that have ended begin their next episodes instead.

        Args:
            actions: integers from 0 to 5, see `rules.Action`; shape (E, n_drones).
            matrices: receives every row's matrix after the step, as from `write_matrices`.
            autoreset: False makes rows that have ended an error.

        Raises:
            ResetNeeded: before the first `reset`, after an interrupted step or reset, or for
                rows that have ended if `autoreset` is False.
            TypeError: the actions are not integers, or `matrices` is not an array.
            ValueError: an action is out of range, or a shape is wrong. After any error of
                the input the batch is unchanged.
        """
        self._check_complete("step")
        drones, world = self._drones, self._world
        if not self.ready:
            raise ResetNeeded("step: no episode has begun; call reset() first")
        chosen = checked_actions(actions, drones.cells.shape, np.int64)
        if matrices is not None:
            self._check_output(matrices)
        beginning = drones.ended.nonzero()[0]
        if beginning.size and not autoreset:
            raise ResetNeeded(
                f"step: the episodes of searches {beginning.tolist()} have ended; reset them "
                "first, in a vector environment with options={'reset_mask': ...}"
            )
        sampled = self._sampled(beginning, self._rng) if self._unused <= 0 else None

        # The input is valid: from here on the batch changes.
        self._changing = True
        chosen[beginning] = Action.IDLE

        # 1. All drones move or search.
        targets, searches = drones.move(chosen)
        rows, cells = drones.row_of.take(searches), drones.cells.take(searches)

        # 2. The rules decide outcomes, rewards and endings.
        probability = world.observed(rows, cells)
        finds = world.search(rows, cells, searches)
        all_found, covered = world.all_found(rows.take(finds)), world.covered(rows)
        found = searches.take(finds)
        drones.resolve(world.step, targets, searches, probability, found, all_found, covered)
        drones.chosen = chosen

        # 3. The clock advances; rows that had ended begin instead.
        world.advance()
        if beginning.size:
            self._begin(beginning, self._counters[:, beginning] + GOLDEN, sampled)
            drones.forget(beginning)
        world.catalogue.forecasts.reach(int(world.step.max()))

        # 4. The new state can be read.
        if matrices is not None:
            world.write_matrices(matrices)
        self._changing = False

    # Parameters.

    @property
    def scenario(self) -> Scenario:
        """The parameters of all searches in their current episodes.

        Before the first `reset`, those of the constructor.

        Raises:
            ValueError: the searches have different persons; see `scenario_of`.
        """
        situation = self._world.situation
        if (situation != situation[0]).any():
            raise ValueError(
                "there is no scenario of all searches, because they have different persons; "
                "scenario_of(row) returns the scenario of one"
            )
        return self.scenario_of(0)

    def scenario_of(self, row: int) -> Scenario:
        """The parameters of one search in its current episode, its persons included.

        Args:
            row: its number, from 0 to E - 1.

        Raises:
            TypeError: `row` is not an integer.
            ValueError: there is no such search.
        """
        row = checks.integer("row", row, 0, self.num_rows - 1)
        return self._world.catalogue.scenarios[int(self._world.situation[row])]

    @property
    def situation(self) -> Ints:
        """The number of every row's situation in the catalogue: int64, (E,)."""
        return self._world.situation.copy()

    # The last step.

    @property
    def rewards(self) -> Floats:
        """The rewards of the last step: float64, (E, n_drones)."""
        return self._drones.rewards

    @property
    def endings(self) -> NDArray[np.int8]:
        """Why the last step ended episodes, each an `Ending`, or 0: int8, (E,)."""
        return self._drones.endings.copy()

    @property
    def ended(self) -> Flags:
        """Rows that begin an episode in place of the next step: bool, (E,)."""
        return self._drones.ended.copy()

    @property
    def searching(self) -> Flags:
        """Which drones searched in the last step: bool, (E, n_drones)."""
        searching: Flags = self._drones.chosen == Action.SEARCH
        return searching

    # The state.

    @property
    def steps(self) -> Ints:
        """Completed steps of every row: int64, (E,)."""
        return self._world.step.copy()

    @property
    def positions(self) -> NDArray[np.int32]:
        """Every drone's cell (x, y): int32, (E, n_drones, 2)."""
        return self._drones.positions

    @property
    def cells(self) -> Ints:
        """Every drone's cell, y * N + x: int64, (E, n_drones)."""
        return self._drones.cells.copy()

    @property
    def missing(self) -> Flags:
        """Which persons have not been found: bool, (E, persons)."""
        return self._world.missing.T.copy()

    @property
    def found(self) -> Flags:
        """Whether any person has been found in the episode: bool, (E,)."""
        found: Flags = ~np.logical_and.reduce(self._world.missing)
        return found

    @property
    def person_cells(self) -> Ints:
        """Every person's cell, y * N + x, hidden from the drones: int64, (E, persons)."""
        return self._world.person_cells.T.copy()

    @property
    def probability_of_success(self) -> Floats | None:
        """The cumulative probability of success (POS) of every row's searches: float64, (E,).

        The mean over persons. None unless beliefs are kept: with `bayesian_update`,
        `RewardScheme.expected()` or the coverage mission.
        """
        return self._world.success()

    @property
    def probability_of_failure(self) -> Floats | None:
        """The probability that no search so far finds each person: float64, (E, persons).

        That of a person who has been found is meaningless. None unless beliefs are kept, see
        `probability_of_success`.
        """
        return self._world.failure()

    def frame(self, row: int) -> Frame:
        """Everything that a picture of one row shows, including the persons, but no trails.

        Raises:
            ResetNeeded: after an interrupted step or reset.
        """
        row = checks.integer("row", row, 0, self.num_rows - 1)
        self._check_complete("frame")
        _, positions = grid_of(self._scenario.grid_size)
        scenario = self.scenario_of(row)
        ending, success = self._drones.endings[row], self.probability_of_success
        missing, step = self._world.missing[:, row], int(self._world.step[row])
        finders, find_cells = self._world.finds[..., row]
        persons = np.where(missing, self._world.person_cells[:, row], find_cells)
        found_by = np.where(missing, -1, finders % self._scenario.n_drones)
        if scenario.mission == "coverage":  # it has no persons
            persons = found_by = persons[:0]
        return Frame(
            matrix=self.matrices_of(np.array([row]))[0],
            drones=tuple(positions[cell] for cell in self._drones.cells[row].tolist()),
            searching=tuple(self.searching[row].tolist()),
            persons=tuple(positions[cell] for cell in persons.tolist()),
            found_by=tuple(None if drone < 0 else drone for drone in found_by.tolist()),
            step=step,
            timestep_limit=self._scenario.timestep_limit,
            vector=scenario.mean_vector,
            ending=Ending(ending) if ending else None,
            hypotheses=tuple(self._world.hypotheses(row)),
            probability_of_success=None if success is None else float(success[row]),
            prior=self._world.prior(row) if self._world.shows_belief(row) else None,
            total_return=sum(self._drones.returns[row].tolist()),
        )

    # The matrices.

    def write_matrices(self, out: Singles) -> None:
        """Write the matrix of every row: float32, (E, N, N), C-contiguous, indexed [y, x].

        Raises:
            ResetNeeded: after an interrupted step or reset.
            TypeError: `out` is not an array.
            ValueError: `out` has another shape, dtype or order, or is read-only.
        """
        self._check_output(out)
        self._check_complete("write_matrices")
        self._world.write_matrices(out)

    def _check_output(self, matrices: Singles) -> None:
        size = self._scenario.grid_size
        checks.output_array("matrices", matrices, (self.num_rows, size, size), np.float32)

    def matrices_of(self, rows: Ints) -> Singles:
        """The matrices of some rows: float32, (n, N, N), indexed [y, x].

        Args:
            rows: their numbers, in ascending order.

        Raises:
            ResetNeeded: after an interrupted step or reset.
            TypeError: the rows are not integers.
            ValueError: there is no such row, or they are not in ascending order.
        """
        rows = checks.row_numbers(rows, self.num_rows, ascending=True)
        self._check_complete("matrices_of")
        return self._world.matrices(rows)

    def state_planes(self) -> Singles:
        """The full state of every row, see `DroneSwarmSearch.state`: float32, (E, 3, N, N).

        Raises:
            ResetNeeded: after an interrupted step or reset.
        """
        missing = self.missing
        if self._scenario.mission == "coverage":  # it has no persons
            missing[:] = False
        matrices = self.matrices_of(self._rows)
        return batch_state_planes(matrices, self.cells, self.person_cells, missing)

    def probabilities(self, rows: Ints, cells: Ints) -> Singles:
        """The matrix entries of one cell in each of some rows: float32, (n,).

        Args:
            rows: their numbers, in ascending order; a row may occur several times.
            cells: y * N + x, shape (n,).

        Raises:
            ResetNeeded: after an interrupted step or reset.
            TypeError: the rows or cells are not integers.
            ValueError: there is no such row or cell, or the rows are not in ascending order.
        """
        self._check_complete("probabilities")
        rows = checks.row_numbers(rows, self.num_rows, ascending=True, repeated=True)
        numbers = checks.cell_numbers(cells, rows.shape, self._scenario.grid_size)
        return self._world.probabilities(rows, numbers)

    @property
    def table(self) -> Singles:
        """The table of matrices, which all rows share: float32, (entries, N, N); read-only.

        Another catalogue makes a new table.

        Raises:
            ValueError: there is no table without `wants_table`, or the matrices depend on the
                searches.
        """
        self._check_table()
        return self._world.catalogue.forecasts.table

    @property
    def table_index(self) -> Ints:
        """The entry of `table` that is the matrix of each row: int64, (E,)."""
        self._check_table()
        return self._world.table_index

    def _check_table(self) -> None:
        if not self._world.catalogue.complete:
            raise ValueError("there is no table of matrices without wants_table=True")
        if self._scenario.bayesian_update or len(self._world.missing) > 1:
            raise ValueError(
                "with bayesian_update or several persons there is no table of matrices"
            )
