"""The batch: many searches stepped together, arrays in and arrays out.

A step goes through the four phases of the single environment, for all rows at once:

1. all drones move or search, given the state they were shown;
2. `outcomes` applies the rules: rewards and endings;
3. the clock advances: the persons drift, and so do the beliefs, in background threads where
   that saves time;
4. the new state can be read: positions, matrices, or indices into the table of matrices.

A row whose episode has ended begins its next one in place of the following step, or earlier
in `restart`.
"""

from __future__ import annotations

from collections.abc import Container, Mapping, Sequence
from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from DroneSwarmSearch import rules
from DroneSwarmSearch._internal import checks
from DroneSwarmSearch._internal.actions import checked_actions
from DroneSwarmSearch._internal.arrays import Ints, Singles, Words
from DroneSwarmSearch._internal.errors import ResetNeeded
from DroneSwarmSearch._internal.streams import mixed
from DroneSwarmSearch.rules import OFF_GRID, Action, RewardScheme
from DroneSwarmSearch.scenario import Scenario
from DroneSwarmSearch.vector.episodes import Episodes
from DroneSwarmSearch.vector.forecasts import OnTheFlyForecasts
from DroneSwarmSearch.vector.outcomes import Outcomes
from DroneSwarmSearch.vector.parameters import BatchParameters, RowValues, Sampler, checked_rows
from DroneSwarmSearch.vector.readings import BatchReadings
from DroneSwarmSearch.vector.tabulated_forecasts import (
    TabulatedForecasts,
    check_table,
    choose_forecasts,
)
from DroneSwarmSearch.vector.world import BatchState

__all__ = ["SearchBatch"]

# NumPy calculates faster with 0-d arrays than with Python numbers.
_SEARCH, _IDLE, _ACTIONS, _OFF_GRID = (
    np.array(number, np.int16) for number in (Action.SEARCH, Action.IDLE, len(Action), OFF_GRID)
)

# glibc returns large freed blocks to the system, which costs up to a third of a step, until a
# block of this size has been freed once. Without effect on other systems.
_large = np.empty(2**24, np.uint8)
del _large


class SearchBatch(BatchReadings):
    """Many independent searches with the rules, forecasts and random numbers of one.

    Given the same seed and actions, each row reproduces `DroneSwarmSearch` bit for bit.

    Args:
        num_rows: the number of searches, E.
        grid_size: cells along each side, N; this and the next ones as in `DroneSwarmSearch`.
        n_drones: drones in each search, n.
        vector: drift in cells per step, (x, y); or one for each row, shape (E, 2).
        person_initial_position: a cell (x, y), or one for each person, shape (persons, 2),
            for every row; or those of each row, shape (E, persons, 2).
        disperse_constant: how quickly the persons may stray; or one for each row, (E,).
        timestep_limit: the steps in an episode.
        probability_of_detection: one number, or one for each person.
        bayesian_update: whether matrices are posteriors, or the drift forecast alone.
        reward_scheme: the figures of the reward table.
        scenario: all parameters from `grid_size` on, in place of them.
        drones_positions: a cell (x, y) for each drone at the start of every episode, shape
            (n_drones, 2) or (E, n_drones, 2). By default drones stand from left to right
            from (0, 0), row by row.
        sampler: draws new parameters for every episode, see `Sampler`.
        wants_table: keep the matrices of all forecasts and steps in one table, however large.
        rows_name: the name of `num_rows` in error messages.

    Attributes:
        ready: whether every row has begun an episode.

    Raises:
        TypeError: an argument is of the wrong type.
        ValueError: an argument is out of its limits, or given together with a scenario.
    """

    def __init__(
        self,
        num_rows: int,
        *,
        grid_size: int = Scenario.grid_size,
        n_drones: int = Scenario.n_drones,
        vector: ArrayLike = Scenario.vector,
        person_initial_position: ArrayLike = Scenario.person_initial_position,
        disperse_constant: ArrayLike = Scenario.disperse_constant,
        timestep_limit: int = Scenario.timestep_limit,
        probability_of_detection: float | Sequence[float] = Scenario.probability_of_detection,
        bayesian_update: bool = Scenario.bayesian_update,
        reward_scheme: RewardScheme = Scenario.reward_scheme,
        scenario: Scenario | None = None,
        drones_positions: ArrayLike | None = None,
        sampler: Sampler | None = None,
        wants_table: bool = False,
        rows_name: str = "num_rows",
    ) -> None:
        if sampler is not None and not callable(sampler):
            raise TypeError(f"sampler must be callable, or None, got {sampler!r}")
        self._wants_table = checks.boolean("wants_table", wants_table)
        self._sampler = sampler
        self._usual = BatchParameters.from_arguments(
            num_rows,
            rows_name,
            drones_positions,
            sampler is not None,
            scenario,
            grid_size=grid_size,
            n_drones=n_drones,
            vector=vector,
            person_initial_position=person_initial_position,
            disperse_constant=disperse_constant,
            timestep_limit=timestep_limit,
            probability_of_detection=probability_of_detection,
            bayesian_update=bayesian_update,
            reward_scheme=reward_scheme,
        )
        self._now = self._usual.copy()  # those of the present episodes
        self._varies = sampler is not None  # whether they may differ from the usual ones
        self._scenario = scenario = self._usual.scenario
        if wants_table:
            self._check_table(self._usual)

        rows, n, size = self._usual.num_rows, scenario.n_drones, scenario.grid_size
        self._rows = np.arange(rows)
        # Drones are numbered throughout the batch: row * n + drone.
        self._drones_of = np.arange(rows * n).reshape(rows, n)
        self._row_of = self._rows.repeat(n)
        # Cells and actions are stored in narrow integers, which are faster to process.
        largest = size**2 * len(Action)
        kinds = (np.int16, np.int32, np.int64)
        self._narrow: Any = next(kind for kind in kinds if largest <= np.iinfo(kind).max)
        neighbours = rules.neighbours_of_all(size)  # which checks that such tables fit in memory
        super().__init__(size)
        self._neighbours = neighbours.reshape(-1).astype(self._narrow)
        self._collided = rules.Collisions(rows, n, self._narrow)

        self.ready = False
        self._changing = False  # stays True after an interrupted step or reset
        self._episodes = Episodes(rows)
        self._outcomes = Outcomes(scenario, rows)
        self._world = self._new_world()
        self._cells = np.zeros((rows, n), self._narrow)
        self._chosen = np.full((rows, n), _IDLE, self._narrow)  # the last step's actions

    def _new_world(self) -> BatchState:
        scenario = self._scenario
        detections, updates = scenario.detections, scenario.bayesian_update
        world = BatchState(self._choose_forecasts(), detections, updates, self.num_rows)
        world.assign(self._rows, self._now.forecasts)
        world.begin(self._rows)
        return world

    def _choose_forecasts(self) -> TabulatedForecasts | OnTheFlyForecasts:
        size, steps = self._scenario.grid_size, self._scenario.timestep_limit
        if self._sampler is not None:
            return OnTheFlyForecasts(size, self._now.forecasts)
        forecasts = self._usual.forecasts, self._now.forecasts
        return choose_forecasts(size, steps, *forecasts, wants_table=self._wants_table)

    def _check_table(self, parameters: BatchParameters) -> None:
        size, steps = self._scenario.grid_size, self._scenario.timestep_limit
        check_table(size, steps, parameters.forecasts)

    # Episodes.

    def reset(
        self,
        seeds: Sequence[int | None] | None = None,
        rows: Ints | None = None,
        given: Mapping[str, Any] | None = None,
    ) -> None:
        """Begin episodes.

        Args:
            seeds: one for each of these rows. A row with None continues its sequence of
                episodes, or starts one from system entropy.
            rows: their numbers; all rows by default.
            given: "vector", which also applies to later episodes unless a sampler draws it;
                and "person_initial_position", "disperse_constant" and "drones_positions"
                for this episode only. Each has one value for all rows, or one for each row
                of the batch, and takes precedence over the sampler.

        Raises:
            ResetNeeded: a step or reset was interrupted, and `rows` are not all rows.
            TypeError: a value is of the wrong type.
            ValueError: a value is out of its limits.
        """
        rows = self._rows if rows is None else checked_rows(rows, self.num_rows)
        wanted = self._usual if given is None else self._usual.changed(given)
        if given and self._wants_table:
            self._check_table(wanted)
        seeds = None if seeds is None else checks.seeds("seeds", seeds)
        if seeds is not None and len(seeds) != len(rows):
            raise ValueError(f"seeds must be {len(rows)}, one for each row, got {len(seeds)}")
        if self._changing:
            self._recover(rows)
        self._prepare(rows)
        counters = self._episodes.reseeded(rows, seeds)
        values = self._draw(mixed(counters[2]), given or {})

        # The input is valid: from here on the batch changes.
        self._changing = True
        self._world.prepare(rows, self._episodes.assign(rows, counters))
        self.ready = bool(self._episodes.seeded.all())
        if given:
            self._varies = True
            drift = self._usual.forecasts.drift
            drift[:, rows] = wanted.forecasts.drift[:, rows]
            self._now.assign(rows, wanted)
            if isinstance(self._world.forecasts, TabulatedForecasts):
                self._world.change_forecasts(self._choose_forecasts(), self._now.forecasts)
        self._start(rows, values, wanted)
        self._outcomes.clear(rows)
        self._changing = False

    def restart(self, rows: Ints) -> None:
        """Begin the next episodes of some rows, but keep their last rewards and endings.

        Raises:
            ResetNeeded: before the first `reset`, or after an interrupted step or reset.
            TypeError: the rows are not integers.
            ValueError: there is no such row.
        """
        rows = checked_rows(rows, self.num_rows)
        self._check_complete("restart")
        if not (self.ready or self._episodes.seeded[rows].all()):
            raise ResetNeeded("restart: not all rows have begun; call reset() first")
        values = self._next(rows)
        self._changing = True
        self._start(rows, values, self._usual)
        self._changing = False

    def _recover(self, rows: Ints) -> None:
        """Replace the state that an interrupted step or reset has left incomplete."""
        if np.unique(rows).size < self.num_rows:
            raise ResetNeeded("reset: a step or reset was interrupted; reset all searches")
        self._episodes.forget_prepared()
        self._world = self._new_world()

    def _start(self, rows: Ints, values: RowValues, parameters: BatchParameters) -> None:
        """Begin episodes outside of a step."""
        drones = self._begin(rows, values, parameters)
        self._world.begin(rows)
        self._outcomes.ended[rows] = False
        self._chosen.reshape(-1)[drones] = _IDLE

    def _begin(self, rows: Ints, values: RowValues, parameters: BatchParameters) -> Ints:
        """Set the parameters and drones of prepared rows; the persons begin separately.

        Args:
            rows: their numbers.
            values: the sampler's values for them.
            parameters: the other parameters.

        Returns:
            The numbers of their drones.
        """
        self._episodes.begin(rows)
        if self._varies:
            self._now.assign(rows, parameters)
            self._now.assign_values(rows, values)
            self._world.assign(rows, self._now.forecasts)
        drones = self._drones_of.take(rows, axis=0).reshape(-1)
        self._cells.reshape(-1)[drones] = self._now.drones.take(drones)
        self._outcomes.begin(drones)
        return drones

    def _next(self, rows: Ints) -> RowValues:
        """Prepare the next episodes of some rows; returns the sampler's values for them."""
        self._prepare(rows)
        if self._sampler is None:
            return {}
        return self._draw(self._episodes.sampling_keys(rows))

    def _prepare(self, rows: Ints) -> None:
        """Set the random keys of the next episodes, unless these rows have them already."""
        if self._episodes.prepared(rows):
            return
        before, self._changing = self._changing, True
        self._world.prepare(*self._episodes.prepare_all())
        self._changing = before

    def _draw(self, keys: Words, given: Container[str] = ()) -> RowValues:
        """The sampler's values for some episodes, except for given ones."""
        if self._sampler is None:
            return {}
        drawn = self._usual.drawn(len(keys), self._sampler, keys)
        return {name: value for name, value in drawn.items() if name not in given}

    # A step.

    def step(
        self, actions: ArrayLike, matrices: Singles | None = None, *, autoreset: bool = True
    ) -> None:
        """Let every drone act once; rows that have ended begin their next episodes instead.

        Args:
            actions: integers from 0 to 5, see `rules.Action`; shape (E, n_drones).
            matrices: receives every row's matrix after the step, as from `write_matrices`
                but faster for large batches, because background threads write it.
            autoreset: False makes rows that have ended an error.

        Raises:
            ResetNeeded: before the first `reset`, after an interrupted step or reset, or for
                rows that have ended if `autoreset` is False.
            TypeError: the actions are not integers, or `matrices` is not an array.
            ValueError: an action is out of range, or a shape is wrong. After any error of
                the input the batch is unchanged.
        """
        self._check_complete("step")
        if not self.ready:
            raise ResetNeeded("step: no episode has begun; call reset() first")
        chosen = checked_actions(actions, self._cells.shape, self._narrow)
        if matrices is not None:
            self._check_output(matrices)
        beginning = self._outcomes.ended.nonzero()[0]
        if beginning.size and not autoreset:
            raise ResetNeeded(
                f"step: the episodes of searches {beginning.tolist()} have ended; reset them "
                "first, in a vector environment with options={'reset_mask': ...}"
            )
        values = self._next(beginning) if beginning.size else {}

        # The input is valid: from here on the batch changes.
        self._changing = True
        idle = beginning  # the drones of rows that begin
        if beginning.size:
            idle = self._begin(beginning, values, self._usual)
            chosen.reshape(-1)[idle] = _IDLE

        # 1. All drones move or search.
        moves = self._cells * _ACTIONS
        moves += chosen
        targets = self._neighbours.take(moves, mode="clip")
        searches = (chosen == _SEARCH).reshape(-1).nonzero()[0]
        rows = self._row_of.take(searches)
        cells = self._cells.reshape(-1).take(searches).astype(np.int64)

        # 2. The rules decide outcomes, rewards and endings.
        world, outcomes = self._world, self._outcomes
        probability = world.probabilities(rows, cells).astype(np.float64)
        finds = world.search(rows, cells, searches)
        found = all_found = finds
        if finds.size:
            found, all_found = searches.take(finds), world.all_found(rows.take(finds))

        def decide() -> None:
            left_grid = (targets.reshape(-1) == _OFF_GRID).nonzero()[0]
            collided = self._collided(targets)
            outcomes.decide(
                world.step, searches, probability, found, all_found, left_grid, collided, idle
            )
            if left_grid.size:  # these drones stay where they were
                targets.reshape(-1)[left_grid] = self._cells.reshape(-1).take(left_grid)

        # 3. The clock advances; `decide` runs while background threads write and drift.
        world.advance(rows, cells, beginning, matrices, decide)
        self._cells, self._chosen = targets, chosen
        self._changing = False
