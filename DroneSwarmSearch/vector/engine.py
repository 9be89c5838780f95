"""The batch: many searches stepped together, arrays in and arrays out.

A step goes through the four phases of the single environment, for all rows at once:

1. all drones move or search, given the state they were shown;
2. the rules decide rewards and endings;
3. the clock advances: the persons drift, and so do the beliefs, in background threads where
   that saves time;
4. the new state can be read: positions, matrices, or indices into the table of matrices.

A row whose episode has ended begins its next one in place of the following step, or earlier
in `restart`.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from functools import partial
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from DroneSwarmSearch._internal import checks
from DroneSwarmSearch._internal.actions import checked_actions
from DroneSwarmSearch._internal.arrays import Flags, Floats, Ints, Singles
from DroneSwarmSearch._internal.errors import ResetNeeded
from DroneSwarmSearch._internal.grid import grid_of
from DroneSwarmSearch._internal.streams import mixed
from DroneSwarmSearch.drift.belief import mean_over_missing
from DroneSwarmSearch.drift.persons import Person
from DroneSwarmSearch.frame import Frame
from DroneSwarmSearch.observations import batch_state_planes
from DroneSwarmSearch.rules import Action, Ending, RewardScheme
from DroneSwarmSearch.scenario import Scenario
from DroneSwarmSearch.vector.drones import BatchDrones
from DroneSwarmSearch.vector.episodes import Episodes
from DroneSwarmSearch.vector.forecasts import Forecasts, Mixtures, OnTheFlyForecasts
from DroneSwarmSearch.vector.parameters import (
    DRIFT_PARAMETERS,
    BatchParameters,
    RowValues,
    Sampler,
)
from DroneSwarmSearch.vector.tabulated_forecasts import (
    TabulatedForecasts,
    check_table,
    choose_forecasts,
    distinct,
    forecasts_of_situations,
)
from DroneSwarmSearch.vector.world import BatchState

__all__ = ["SearchBatch"]

_IDLE = np.array(Action.IDLE, np.int16)  # 0-d: NumPy calculates faster than with an int

# glibc returns large freed blocks to the system, which costs up to a third of a step, until a
# block of this size has been freed once. Without effect on other systems.
_large = np.empty(2**24, np.uint8)
del _large


class SearchBatch:
    """Many independent searches with the rules, forecasts and random numbers of one.

    Given the same seed and actions, each row reproduces `DroneSwarmSearch` bit for bit.

    Args:
        num_rows: the number of searches, E.
        grid_size: cells along each side, N; this and the next ones as in `DroneSwarmSearch`.
        n_drones: drones in each search, n.
        vector: drift in cells per step, (x, y); or one for each row, shape (E, 2).
        person_initial_position: a cell (x, y), or one for each person, shape (persons, 2),
            for every row; or those of each row, shape (E, persons, 2).
        disperse_constant: how quickly the persons may stray from the drift; or one for each row,
            (E,).
        timestep_limit: the steps in an episode.
        probability_of_detection: one number, or one for each person.
        bayesian_update: whether matrices are exact posteriors given the searches so far, or
            drift forecasts alone.
        reward_scheme: the figures of the reward table.
        persons: the persons of every row if their start or drift is uncertain, see `Person`;
            in place of `vector`, `person_initial_position`, `disperse_constant` and
            `probability_of_detection`.
        mission: "rescue", to find all persons; or "coverage", to gain as much probability of
            success as possible.
        scenario: all parameters from `grid_size` on, in place of them.
        situations: a catalogue in place of `persons`: a sequence of situations, each a
            sequence of `Person`, the same number in each. Every episode draws one of them with
            equal chances.
        situation: the number of a situation, from 0, for every episode, in place of the draw;
            or one for each row, (E,).
        drones_positions: a cell (x, y) for each drone at the start of every episode, shape
            (n_drones, 2) or (E, n_drones, 2). By default drones stand from left to right
            from (0, 0), row by row.
        sampler: draws new parameters for every episode, see `Sampler`.
        wants_table: keep the matrices of all forecasts and steps in one table, however large.
        finds_last: False simulates searches that never find a search's last missing person,
            although they may find the others.
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
        persons: Sequence[Person] | Person | None = Scenario.persons,
        mission: str = Scenario.mission,
        scenario: Scenario | None = None,
        situations: Sequence[Sequence[Person] | Person] | None = None,
        situation: ArrayLike | None = None,
        drones_positions: ArrayLike | None = None,
        sampler: Sampler | None = None,
        wants_table: bool = False,
        finds_last: bool = True,
        rows_name: str = "num_rows",
    ) -> None:
        if sampler is not None and not callable(sampler):
            raise TypeError(f"sampler must be callable, or None, got {sampler!r}")
        self._wants_table = checks.boolean("wants_table", wants_table)
        self._finds_last = checks.boolean("finds_last", finds_last)
        self._sampler = sampler
        self._usual = BatchParameters.from_arguments(
            num_rows,
            rows_name,
            drones_positions,
            situations,
            situation,
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
            persons=persons,
            mission=mission,
        )
        self._now = self._usual.copy()  # those of the current episodes
        self._varies = sampler is not None  # whether they may differ from the usual ones
        self._scenario = scenario = self._usual.scenario
        if wants_table:
            self._check_table(self._usual)

        self._rows = np.arange(self._usual.num_rows)
        self.ready = False
        self._changing = False  # stays True after an interrupted step or reset
        # The fourth stream draws the persons' starts.
        streams = 3 if self._usual.situations is None else 4
        self._episodes = Episodes(self._usual.num_rows, streams)
        self._drones = BatchDrones(scenario, self._usual.num_rows)
        self._world = self._new_world()

    def _new_world(self) -> BatchState:
        forecasts, situations = self._choose_forecasts(), self._usual.situations
        world = BatchState(self._scenario, forecasts, situations, self.num_rows, self._finds_last)
        if situations is None:
            world.assign(self._rows, self._now.forecasts)
        else:  # until an episode draws one
            situation = self._usual.situation
            world.choose(self._rows, np.zeros_like(self._rows) if situation is None else situation)
        world.begin(self._rows)
        return world

    def _choose_forecasts(self) -> Forecasts:
        size, steps = self._scenario.grid_size, self._scenario.timestep_limit
        if self._usual.situations is not None:
            mixtures = self._usual.situations.mixtures
            persons = len(self._scenario.situation)
            return forecasts_of_situations(
                size, steps, mixtures, persons, self.num_rows, self._wants_table
            )
        now = self._now.forecasts
        if self._sampler is not None:
            mixtures = Mixtures.of_numbers(now.as_numbers().reshape(-1, 5))
            return OnTheFlyForecasts(size, mixtures, len(now.start), self.num_rows)
        usual = self._usual.forecasts
        return choose_forecasts(size, steps, usual, now, wants_table=self._wants_table)

    def _check_table(self, parameters: BatchParameters) -> None:
        """Raise a ValueError if the table of matrices does not fit in memory."""
        if parameters.situations is not None:
            mixtures = parameters.situations.mixtures
        else:
            mixtures = Mixtures.of_numbers(distinct([parameters.forecasts]))
        check_table(self._scenario, mixtures)

    def _check_complete(self, what: str) -> None:
        if self._changing:
            raise ResetNeeded(f"{what}: a step or reset was interrupted; reset all searches first")

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
                and "person_initial_position", "disperse_constant", "situation" and
                "drones_positions" for this episode only. Each has one value for all rows, or
                one for each row of the batch, and takes precedence over the sampler.
                "situation" is for batches with persons or situations, which have none of the
                first three.

        Raises:
            ResetNeeded: a step or reset was interrupted, and `rows` are not all rows.
            TypeError: a value is of the wrong type.
            ValueError: a value is out of its limits.
        """
        rows = self._rows if rows is None else checks.row_numbers(rows, self.num_rows)
        valid = {} if given is None else self._usual.validated(self.num_rows, given, "given")
        wanted = self._usual.changed(valid) if valid else self._usual
        if valid and self._wants_table:
            self._check_table(wanted)
        seeds = None if seeds is None else checks.seeds("seeds", seeds)
        if seeds is not None and len(seeds) != len(rows):
            raise ValueError(f"seeds must be {len(rows)}, one for each row, got {len(seeds)}")
        if self._changing:  # a step or reset was interrupted: replace what it left incomplete
            if np.unique(rows).size < self.num_rows:
                raise ResetNeeded("reset: a step or reset was interrupted; reset all searches")
            self._episodes.forget_prepared()
            self._world = self._new_world()
        self._prepare(rows)
        counters = self._episodes.reseeded(rows, seeds)
        values = self._usual.drawn(self._sampler, mixed(counters[2]))
        values = {name: value for name, value in values.items() if name not in valid}
        if "situation" in valid:
            values["situation"] = valid["situation"][rows]

        # The input is valid: from here on the batch changes.
        self._changing = True
        self._episodes.assign(rows, counters)
        self._world.prepare(rows, counters, self._usual.situation)
        self.ready = bool(self._episodes.seeded.all())
        if valid:
            self._varies = True
            self._now.assign(rows, wanted)
        if not valid.keys().isdisjoint(DRIFT_PARAMETERS):
            drift = self._usual.forecasts.drift
            drift[:, rows] = wanted.forecasts.drift[:, rows]
            if isinstance(self._world.forecasts, TabulatedForecasts):
                self._world.change_forecasts(self._choose_forecasts(), self._now.forecasts)
        self._start(rows, values, wanted)
        self._drones.clear(rows)
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
        if not (self.ready or self._episodes.seeded[rows].all()):
            raise ResetNeeded("restart: not all rows have begun; call reset() first")
        values = self._next(rows)
        self._changing = True
        self._start(rows, values, self._usual)
        self._changing = False

    def _start(self, rows: Ints, values: RowValues, parameters: BatchParameters) -> None:
        """Begin episodes outside of a step."""
        drones = self._begin(rows, values, parameters)
        self._world.begin(rows)
        self._drones.ended[rows] = False
        self._drones.chosen.reshape(-1)[drones] = _IDLE

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
            if self._usual.situations is None:
                self._world.assign(rows, self._now.forecasts)
            elif "situation" in values:
                self._world.choose(rows, values["situation"])
        return self._drones.begin(rows, self._now.drones)

    def _next(self, rows: Ints) -> RowValues:
        """Prepare the next episodes of some rows; returns the sampler's values for them."""
        self._prepare(rows)
        if self._sampler is None:  # saves computing the keys
            return {}
        return self._usual.drawn(self._sampler, self._episodes.sampling_keys(rows))

    def _prepare(self, rows: Ints) -> None:
        """Set the random keys of the next episodes, unless these rows have them already."""
        if self._episodes.prepared(rows):
            return
        before, self._changing = self._changing, True
        self._world.prepare(*self._episodes.prepare_all(), self._usual.situation)
        self._changing = before

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
        chosen = checked_actions(actions, self._drones.cells.shape, self._drones.dtype)
        if matrices is not None:
            self._check_output(matrices)
        beginning = self._drones.ended.nonzero()[0]
        if beginning.size and not autoreset:
            raise ResetNeeded(
                f"step: the episodes of searches {beginning.tolist()} have ended; reset them "
                "first, in a vector environment with options={'reset_mask': ...}"
            )
        values = self._next(beginning) if beginning.size else {}

        # The input is valid: from here on the batch changes.
        self._changing = True
        drones, world = self._drones, self._world
        idle = beginning  # the drones of rows that begin
        if beginning.size:
            idle = self._begin(beginning, values, self._usual)
            chosen.reshape(-1)[idle] = _IDLE

        # 1. All drones move or search.
        targets, searches = drones.move(chosen)
        rows = drones.row_of.take(searches)
        cells = drones.cells.reshape(-1).take(searches).astype(np.int64)

        # 2. The rules decide outcomes, rewards and endings.
        probability = world.observed(rows, cells)
        finds = world.search(rows, cells, searches)
        found = all_found = finds
        if finds.size:
            found, all_found = searches.take(finds), world.all_found(rows.take(finds))

        outcome = targets, searches, probability, found, all_found, world.covered(rows), idle
        resolve = partial(drones.resolve, world.step, *outcome)

        # 3. The clock advances; `resolve` runs while background threads write and drift.
        world.advance(beginning, matrices, resolve)
        drones.cells, drones.chosen = targets, chosen
        self._changing = False

    # Parameters.

    @property
    def num_rows(self) -> int:
        """The number of searches, E."""
        return self._now.num_rows

    @property
    def scenario(self) -> Scenario:
        """The parameters of all searches in their current episodes.

        Before the first `reset`, those of the constructor.

        Raises:
            ValueError: the searches have different parameters; see `scenario_of`.
        """
        return self._now.common_scenario(self._world.situation)

    def scenario_of(self, row: int) -> Scenario:
        """The parameters of one search in its current episode.

        With situations, its `persons` are those of the search's situation.

        Args:
            row: its number, from 0 to E - 1.

        Raises:
            TypeError: `row` is not an integer.
            ValueError: there is no such search.
        """
        row = checks.integer("row", row, 0, self.num_rows - 1)
        return self._now.scenario_of(row, int(self._world.situation[row]))

    @property
    def parameters(self) -> RowValues:
        """Every row's parameters in its current episode, in the form that `reset` accepts."""
        return self._now.to_dict(self._world.situation)

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
        return self._drones.searching

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
        return self._drones.cells.astype(np.int64)

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
        hypotheses = [person.weights for person in scenario.situation]
        missing, step = self._world.missing[:, row], int(self._world.step[row])
        shown, prior = self._world.shown_weights(row), None
        if shown is not None:
            forecasts = [forecast.exact(step) for forecast in scenario.forecasts()]
            prior = mean_over_missing(forecasts, missing.nonzero()[0].tolist()).astype(np.float32)
            pairs = zip(shown.tolist(), hypotheses, strict=True)
            hypotheses = [tuple(weights[: len(own)]) for weights, own in pairs]
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
            hypotheses=tuple(hypotheses),
            probability_of_success=None if success is None else float(success[row]),
            prior=prior,
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

        A copy of the table that the batch uses. It is filled as episodes advance; entries
        that `table_index` has returned do not change. A reset with given parameters makes a
        new table.

        Raises:
            ValueError: the matrices depend on the searches, or do not fit into a table.
        """
        return self._world.tabulated().matrices

    @property
    def table_index(self) -> Ints:
        """The entry of `table` that is the matrix of each row: int64, (E,)."""
        entries: Ints = self._world.tabulated().entries[0].copy()
        return entries
