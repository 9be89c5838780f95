"""The engine: many searches stepped together, arrays in and arrays out.

A step goes through the phases of the single environment's, for all rows at once:

1. all drones move or search, against the state they were shown;
2. `rules` decides outcomes, rewards and endings: rows in which nothing but searches in
   vain happens, nearly all of them, by the table's last two lines, the others by all; the
   persons drift, and beside both, on other processors if that pays, so does what is known;
3. the clock advances;
4. the new state can be read: positions, matrices or their places in the shared table.

A row whose episode has ended begins its next one in place of the step that follows, or
earlier if `restart` is called.
"""

from __future__ import annotations

from collections.abc import Container, Mapping, Sequence
from dataclasses import replace
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from DroneSwarmSearch import rules
from DroneSwarmSearch._internal import checks
from DroneSwarmSearch._internal.errors import ResetNeeded
from DroneSwarmSearch._internal.grid import grid_of
from DroneSwarmSearch._internal.streams import GOLDEN, mixed, stream_keys
from DroneSwarmSearch.rendering.frame import Frame
from DroneSwarmSearch.rules import OFF_GRID, Action, Ending, RewardScheme
from DroneSwarmSearch.scenario import Scenario, check_alone
from DroneSwarmSearch.vector.collisions import Collisions
from DroneSwarmSearch.vector.forecasts import (
    OnTheFlyForecasts,
    TabulatedForecasts,
    check_table,
    choose_forecasts,
)
from DroneSwarmSearch.vector.parameters import Parameters, Sampler, Values, checked_rows
from DroneSwarmSearch.vector.world import BatchState

__all__ = ["SearchBatch"]

Floats = NDArray[np.float64]
Ints = NDArray[np.int64]
Words = NDArray[np.uint64]
Flags = NDArray[np.bool_]
Singles = NDArray[np.float32]
Narrow = NDArray[Any]  # int16, or int32 on large grids

# Arrays calculate faster with arrays without axes than with numbers.
_SEARCH, _IDLE, _ACTIONS, _OFF_GRID = (
    np.array(number, np.int16) for number in (Action.SEARCH, Action.IDLE, len(Action), OFF_GRID)
)
_NOBODY: Ints = np.empty(0, np.int64)
_NOTHING: Floats = np.empty(0)

# Until a large piece of memory has been freed once, glibc hands what a step's arrays free
# back to the system, which then maps it anew, page by page, for the next step's: a third
# of a step's time at worst. Elsewhere this does nothing.
_large = np.empty(2**24, np.uint8)
del _large


class SearchBatch:
    """Independent searches with the rules, the forecast and the random numbers of one.

    Row i with some seed goes through the very episodes that `DroneSwarmSearch` goes
    through with that seed and the same actions, to the last bit.

    Args:
        num_rows: the number of searches, E.
        grid_size: cells along each side, N; this and what follows as in `DroneSwarmSearch`.
        n_drones: drones in each search, n.
        vector: drift in cells per step, (x, y); or one for each row, shape (E, 2).
        person_initial_position: a cell (x, y), or one for each person, shape (persons, 2),
            for every row; or these for each row, shape (E, persons, 2).
        disperse_constant: how quickly the persons may stray; or one for each row, (E,).
        timestep_limit: the steps in an episode.
        probability_of_detection: one number, or one for each person.
        bayesian_update: whether matrices are posteriors, or the drift alone.
        reward_scheme: the figures of the reward table.
        scenario: all of these but `num_rows`, in place of them.
        drones_positions: a cell (x, y) for each drone at the beginning of every episode,
            shape (n_drones, 2) or (E, n_drones, 2); without it drones stand from left
            to right from (0, 0), row by row.
        sampler: draws parameters anew for every episode, see `parameters.Sampler`.
        wants_table: keep the matrices of all forecasts and steps in one table, however large.
        rows_name: what `num_rows` is called in errors.

    Attributes:
        rewards: of the last step: float64, (E, n_drones).
        ready: whether every row has begun an episode.

    Raises:
        TypeError: an argument is of the wrong type.
        ValueError: an argument is out of its limits.
    """

    def __init__(
        self,
        num_rows: int,
        *,
        grid_size: int = 7,
        n_drones: int = 1,
        vector: ArrayLike = (-0.5, -0.5),
        person_initial_position: ArrayLike = (0, 0),
        disperse_constant: ArrayLike = 10,
        timestep_limit: int = 100,
        probability_of_detection: float | Sequence[float] = 1.0,
        bayesian_update: bool = False,
        reward_scheme: RewardScheme = RewardScheme(),  # noqa: B008 (frozen)
        scenario: Scenario | None = None,
        drones_positions: ArrayLike | None = None,
        sampler: Sampler | None = None,
        wants_table: bool = False,
        rows_name: str = "num_rows",
    ) -> None:
        if sampler is not None and not callable(sampler):
            raise TypeError(f"sampler must be callable, or None, got {sampler!r}")
        wants_table = checks.boolean("wants_table", wants_table)
        parameters: dict[str, Any] = {
            "grid_size": grid_size,
            "n_drones": n_drones,
            "vector": vector,
            "person_initial_position": person_initial_position,
            "disperse_constant": disperse_constant,
            "timestep_limit": timestep_limit,
            "probability_of_detection": probability_of_detection,
            "bayesian_update": bayesian_update,
            "reward_scheme": reward_scheme,
        }
        if scenario is not None:
            check_alone(scenario, parameters)
            parameters = {name: getattr(scenario, name) for name in parameters}
        self._usual = Parameters.checked(
            num_rows,
            rows_name=rows_name,
            follows=sampler is not None,
            drones_positions=drones_positions,
            **parameters,
        )
        self._now = self._usual.copy()  # of the episodes under way
        self._varies = sampler is not None  # whether these may differ from the usual
        self._sampler = sampler
        self._scenario = self._usual.scenario  # what all rows share in it counts
        scenario = self._scenario
        self._wants_table = wants_table
        if wants_table:
            self._check_table(self._usual)
        self._several = len(scenario.person_initial_position) > 1
        rows, n = self._usual.num_rows, scenario.n_drones
        self._rows = np.arange(rows)
        # Drones are numbered throughout the batch: those of each row, and the row of each.
        self._drones_of = np.arange(rows * n).reshape(rows, n)
        self._row_of = self._rows.repeat(n)
        # Cells and actions lie in narrow integers, of which many are worked on at once.
        largest = scenario.grid_size**2 * len(Action)
        kinds = (np.int16, np.int32, np.int64)
        self._narrow: Any = next(kind for kind in kinds if largest <= np.iinfo(kind).max)
        neighbours = rules.neighbours_of_all(scenario.grid_size)
        self._neighbours = neighbours.reshape(-1).astype(self._narrow)
        self._positions = _positions(scenario.grid_size)
        self._collided = Collisions(rows, n, self._narrow)
        self._last_step = np.array(scenario.timestep_limit - 1)

        # For each stream its key plus what counts the episodes: of a row that is prepared the
        # next one, else the present one. Rows are prepared many at a time, which is cheaper.
        self._episode_counters = np.zeros((3, rows), np.uint64)
        self._prepared = np.zeros(rows, np.bool_)
        self._seeded = np.zeros(rows, np.bool_)
        self.ready = False
        self._changing = False  # whether a step or reset has begun and not been completed
        self._state = self._new_state()
        self._cells = np.zeros((rows, n), self._narrow)
        self._chosen = np.full((rows, n), _IDLE, self._narrow)
        self._beyond_step = np.zeros((rows, n))  # each drone's return less what `step` pays
        # Drones that have found one of several persons; to find a single one ends the episode.
        self._finders = np.zeros((rows, n), np.bool_)
        self.rewards: Floats = np.zeros((rows, n))
        self._endings = np.zeros(rows, np.int8)
        self._ended = np.ones(rows, np.bool_)

    @property
    def num_rows(self) -> int:
        """The number of searches, E."""
        return len(self._rows)

    @property
    def scenario(self) -> Scenario:
        """The parameters of all searches in their present episodes.

        Before the first `reset`, those of the constructor.

        Raises:
            ValueError: they differ between searches; see `scenario_of`.
        """
        start, drift, constant = self._now.forecasts
        for name, values in (
            ("vector", drift),
            ("person_initial_position", start),
            ("disperse_constant", constant),
        ):
            if (values != values[..., :1]).any():
                raise ValueError(
                    f"there is no scenario of all searches, because they differ in {name}; "
                    "scenario_of(row) gives the scenario of one"
                )
        return self.scenario_of(0)

    def scenario_of(self, row: int) -> Scenario:
        """The parameters of one search in its present episode.

        Args:
            row: its number, from 0 to E - 1.

        Raises:
            TypeError: `row` is not an integer.
            ValueError: there is no such search.
        """
        row = checks.integer("row", row, 0, self.num_rows - 1)
        start, drift, constant = self._now.forecasts
        x, y = drift[:, row].tolist()
        return replace(
            self._scenario,
            vector=(x, y),
            person_initial_position=tuple((x, y) for x, y in start[..., row].tolist()),
            disperse_constant=float(constant[row]),
        )

    # Beginning.

    def _new_state(self) -> BatchState:
        scenario = self._scenario
        forecasts = self._choose_forecasts()
        seas = BatchState(forecasts, scenario.detections, scenario.bayesian_update, self.num_rows)
        seas.assign(self._rows, self._now.forecasts)
        seas.begin(self._rows)
        return seas

    def reset(
        self,
        seeds: Sequence[int | None] | None = None,
        rows: Ints | None = None,
        given: Mapping[str, Any] | None = None,
    ) -> None:
        """Begin episodes.

        Args:
            seeds: one for each of these rows; with None a row's sequence of episodes goes
                on, or begins from the system's entropy.
            rows: which; all of them without it.
            given: "vector", which stays for later episodes (unless a sampler draws it), and
                for this episode alone "person_initial_position", "disperse_constant" and
                "drones_positions", each one for all rows or one for each row of the batch.
                What is given wins over the sampler.

        Raises:
            ResetNeeded: a step or reset was interrupted, and only some rows are to be reset.
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
        grown = {
            k: stream_keys(seed)
            for k, seed in enumerate([None] * len(rows) if seeds is None else seeds)
            if seed is not None or not self._seeded[rows[k]]
        }
        if self._changing:
            self._recover(rows)
        self._prepare(rows)
        counters = self._episode_counters[:, rows]
        for k, keys in grown.items():
            counters[:, k] = keys + GOLDEN
        values = self._sampled(counters[2], given or {})

        # Everything is checked: from here on the batch changes.
        self._changing = True
        self._episode_counters[:, rows] = counters
        self._state.prepare(rows, mixed(counters[:2]))
        self._seeded[rows] = True
        self.ready = bool(self._seeded.all())
        if given:
            self._varies = True
            self._usual.forecasts.drift[:, rows] = wanted.forecasts.drift[:, rows]
            self._now.assign(rows, wanted)
            if isinstance(self._state.forecasts, TabulatedForecasts):
                self._state.change_forecasts(self._choose_forecasts(), self._now.forecasts)
        self._start(rows, values, wanted)
        self.rewards = self.rewards.copy()  # a caller may have kept it
        self.rewards[rows] = 0.0
        self._endings[rows] = 0
        self._changing = False

    def restart(self, rows: Ints) -> None:
        """Begin the next episodes of some rows; what the last step brought them stays.

        Raises:
            ResetNeeded: before the first `reset`, and after an interrupted step or reset.
            TypeError, ValueError: the rows are no numbers of searches.
        """
        rows = checked_rows(rows, self.num_rows)
        self._check_whole("restart")
        if not (self.ready or self._seeded[rows].all()):
            raise ResetNeeded("restart: not all rows have begun; call reset() first")
        values = self._next(rows)
        self._changing = True
        self._start(rows, values, self._usual)
        self._changing = False

    def _recover(self, rows: Ints) -> None:
        """Make whatever an interrupted step or reset has left half done anew."""
        if np.unique(rows).size < self.num_rows:
            raise ResetNeeded("reset: a step or reset was interrupted; reset all searches")
        self._episode_counters[:, self._prepared] -= GOLDEN
        self._prepared[...] = False
        self._state = self._new_state()

    def _check_whole(self, what: str) -> None:
        if self._changing:
            raise ResetNeeded(f"{what}: a step or reset was interrupted; reset all searches first")

    def _start(self, rows: Ints, values: Values, parameters: Parameters) -> None:
        """Begin episodes outside of a step."""
        drones = self._begin(rows, values, parameters)
        self._state.begin(rows)
        self._ended[rows] = False
        self._chosen.reshape(-1)[drones] = _IDLE

    def _next(self, rows: Ints) -> Values:
        """Prepare the next episodes of some rows; returns what is sampled for them."""
        self._prepare(rows)
        return self._sampled(self._episode_counters[2].take(rows))

    def _prepare(self, rows: Ints) -> None:
        """See to it that the next episodes of some rows, and perhaps of others, are prepared."""
        if np.count_nonzero(self._prepared.take(rows)) == len(rows):
            return
        before, self._changing = self._changing, True
        rows = (~self._prepared).nonzero()[0]
        counters = self._episode_counters[:, rows] + GOLDEN
        self._episode_counters[:, rows] = counters
        self._state.prepare(rows, mixed(counters[:2]))
        self._prepared[rows] = True
        self._changing = before

    def _sampled(self, counters: Words, given: Container[str] = ()) -> Values:
        """What the sampler, if there is one, draws for some episodes, but for what is given."""
        if self._sampler is None:
            return {}
        drawn = self._usual.drawn(len(counters), self._sampler, mixed(counters))
        return {name: value for name, value in drawn.items() if name not in given}

    def _begin(self, rows: Ints, values: Values, parameters: Parameters) -> Ints:
        """Set the drones of some rows at their places; the seas begin separately.

        Args:
            rows: their numbers; their episodes are prepared.
            values: what the sampler has drawn for them.
            parameters: of all rows, but for those.

        Returns:
            The numbers of these drones.
        """
        self._prepared[rows] = False
        if self._varies:
            self._now.assign(rows, parameters)
            self._now.assign_values(rows, values)
            self._state.assign(rows, self._now.forecasts)
        drones = self._drones_of.take(rows, axis=0).reshape(-1)
        self._cells.reshape(-1)[drones] = self._now.drones.take(drones)
        self._beyond_step.reshape(-1)[drones] = 0.0
        if self._several:
            self._finders.reshape(-1)[drones] = False
        return drones

    def _check_table(self, parameters: Parameters) -> None:
        size, steps = self._scenario.grid_size, self._scenario.timestep_limit
        check_table(size, steps, parameters.forecasts)

    def _choose_forecasts(self) -> TabulatedForecasts | OnTheFlyForecasts:
        size, steps = self._scenario.grid_size, self._scenario.timestep_limit
        if self._sampler is not None:
            return OnTheFlyForecasts(size, self._now.forecasts)
        forecasts = self._usual.forecasts, self._now.forecasts
        return choose_forecasts(size, steps, *forecasts, wants_table=self._wants_table)

    # A step.

    def step(
        self, actions: ArrayLike, matrices: Singles | None = None, *, autoreset: bool = True
    ) -> None:
        """Let every drone act once; rows that are over begin their next episodes instead.

        Args:
            actions: integers from 0 to 5, see `rules.Action`; shape (E, n_drones).
            matrices: receives every row's matrix after the step, as from `write_matrices`,
                which is slower where matrices are many: here others write beside the step.
            autoreset: False: rows that are over are an error.

        Raises:
            ResetNeeded: before the first `reset`, after an exception (Ctrl-C, for example)
                interrupted a step or reset, and where rows are over that may not begin.
            TypeError: the actions are no integers, or what is to receive matrices no array.
            ValueError: they are out of range, or something is of another shape. As with
                every error, the batch is as it was.
        """
        chosen = self._checked(actions)
        if matrices is not None:
            self._check_receiver(matrices)
        beginning = self._ended.nonzero()[0]
        if beginning.size and not autoreset:
            raise ResetNeeded(
                f"step: the episodes of searches {beginning.tolist()} are over; reset them first, "
                "in a vector environment with options={'reset_mask': ...}"
            )
        values = self._next(beginning) if beginning.size else {}

        # Everything is checked: from here on the batch changes.
        self._changing = True
        if beginning.size:
            idle = self._begin(beginning, values, self._usual)
            chosen.reshape(-1)[idle] = _IDLE

        # 1. Every drone moves or searches.
        moves = self._cells * _ACTIONS
        moves += chosen
        targets = self._neighbours.take(moves, mode="clip")
        searches = (chosen == _SEARCH).reshape(-1).nonzero()[0]
        rows = self._row_of.take(searches)
        cells = self._cells.reshape(-1).take(searches).astype(np.int64)

        # 2. Outcomes, rewards and endings; the persons drift, and what is known.
        shown = self._state.shown(rows, cells).astype(np.float64)
        finds = self._state.search(rows, cells, searches)

        def judge_and_walk() -> None:
            self._judge(targets, searches, shown, finds, rows)
            self._state.walk()

        self._state.go_on(rows, cells, beginning, matrices, judge_and_walk)
        self._cells, self._chosen = targets, chosen

        # 3. The clock advances.
        self._state.advance(beginning, matrices)
        if beginning.size:
            self.rewards.reshape(-1)[idle] = 0.0
        self._changing = False

    def _judge(
        self, targets: Narrow, searches: Ints, shown: Floats, finds: Ints, rows: Ints
    ) -> None:
        """Work out rewards and endings; who tried to leave the grid is put back.

        Args:
            targets: where every drone tried to go.
            searches: the drones that searched.
            shown: what each of these was shown of its cell.
            finds: the searches that have found somebody, by place in `searches`.
            rows: the row of every search.
        """
        scheme, limit = self._scenario.reward_scheme, self._scenario.timestep_limit
        wanted, steps = targets.reshape(-1), self._state.step
        left_grid = (wanted == _OFF_GRID).nonzero()[0]
        collided = self._collided(targets)
        last = np.greater(np.equal(steps, self._last_step), self._ended).nonzero()[0]
        timed_out = finders = steps_before = all_found = _NOBODY
        so_far = _NOTHING
        if last.size:
            timed_out = self._drones_of.take(last, axis=0).reshape(-1)
            if self._several:
                timed_out = timed_out[~self._finders.take(timed_out)]
            so_far = scheme.step * (limit - 1) + self._beyond_step.take(timed_out)
        if finds.size:
            finders, where = searches.take(finds), rows.take(finds)
            steps_before = steps.take(where)
            all_found = self._note_finds(finders, where)
        paid = rules.rewards(
            scheme,
            targets.size,
            searched=searches,
            probability=shown,
            timed_out=timed_out,
            return_so_far=so_far,
            found=finders,
            steps_before=steps_before,
            timestep_limit=limit,
            left_grid=left_grid,
            collided=collided,
        )
        self.rewards = paid.reshape(targets.shape)
        self._beyond_step += self.rewards - scheme.step
        self._endings = rules.endings(
            len(steps),
            all_found=all_found,
            any_collided=self._row_of.take(collided),
            any_left_grid=self._row_of.take(left_grid),
            time_limit_reached=last,
        )
        self._ended = self._endings != 0
        if left_grid.size:
            wanted[left_grid] = self._cells.reshape(-1).take(left_grid)

    def _note_finds(self, finders: Ints, rows: Ints) -> Ints:
        """Note drones that have found somebody; returns those of their rows where all are found."""
        if not self._several:
            return rows
        self._finders.reshape(-1)[finders] = True
        missing = self._state.missing.take(rows, axis=1)
        of_all: Ints = rows[~np.logical_or.reduce(missing)]
        return of_all

    def _checked(self, actions: ArrayLike) -> Narrow:
        """A copy of the actions in narrow integers, shape (E, n_drones)."""
        self._check_whole("step")
        if not self.ready:
            raise ResetNeeded("step: no episode has begun; call reset() first")
        try:
            given = np.asarray(actions)
        except ValueError:  # rows of different lengths
            raise ValueError(f"{self._wanted_shape()}, got {actions!r}") from None
        if given.dtype.kind not in "iu":
            raise TypeError(f"actions must be integers from 0 to 5, got {given.dtype}")
        if given.shape != self._cells.shape:
            raise ValueError(f"{self._wanted_shape()}, got {given.shape}")
        # Seen without their signs, negative numbers are large.
        whole = np.ascontiguousarray(given, np.int64)
        unsigned = whole.reshape(-1).view(np.uint64)
        if np.maximum.reduce(unsigned) >= len(Action):
            row, drone = divmod(int((unsigned >= len(Action)).argmax()), given.shape[1])
            raise ValueError(
                f"actions must be integers from 0 to 5, got {given[row, drone]} "
                f"for drone {drone} of search {row}"
            )
        return whole.astype(self._narrow)

    def _wanted_shape(self) -> str:
        shape = self._cells.shape
        return f"actions must have the shape {shape}, one for each drone of each search"

    # What can be seen.

    @property
    def endings(self) -> NDArray[np.int8]:
        """Why the last step ended episodes, each an `Ending`, or 0: int8, (E,); a new array."""
        return self._endings.copy()

    @property
    def ended(self) -> Flags:
        """Rows that begin anew in place of the next step: bool, (E,); a new array."""
        return self._ended.copy()

    @property
    def steps(self) -> Ints:
        """Completed steps of every row: int64, (E,)."""
        return self._state.step.copy()

    @property
    def positions(self) -> NDArray[np.int32]:
        """Every drone's cell (x, y): int32, (E, n_drones, 2); a new array."""
        pairs = self._positions.take(self._cells, mode="clip")
        return pairs.view(np.int32).reshape(*self._cells.shape, 2)

    @property
    def cells(self) -> Ints:
        """Every drone's cell, y * N + x: int64, (E, n_drones)."""
        return self._cells.astype(np.int64)

    @property
    def searching(self) -> Flags:
        """Which drones searched in the last step: bool, (E, n_drones)."""
        searched: Flags = self._chosen == _SEARCH
        return searched

    @property
    def missing(self) -> Flags:
        """Which persons have not been found: bool, (E, persons)."""
        return self._state.missing.T.copy()

    @property
    def found(self) -> Flags:
        """Whether a person has been found in the episode: bool, (E,)."""
        found: Flags = ~np.logical_and.reduce(self._state.missing)
        return found

    @property
    def person_cells(self) -> Ints:
        """Where every person is, y * N + x: int64, (E, persons). No drone is shown this."""
        return self._state.person_cells.T.copy()

    @property
    def parameters(self) -> dict[str, NDArray[Any]]:
        """Every row's parameters in its present episode, as `reset` takes them."""
        now, size = self._now, self._scenario.grid_size
        return {
            "vector": now.forecasts.drift.T.copy(),
            "person_initial_position": now.forecasts.start.transpose(2, 0, 1).copy(),
            "disperse_constant": now.forecasts.disperse_constant.copy(),
            "drones_positions": np.stack(np.divmod(now.drones, size)[::-1], axis=-1),
        }

    def frame(self, row: int) -> Frame:
        """Everything a picture of a row's present state shows, the persons included.

        Raises:
            ResetNeeded: after an interrupted step or reset.
        """
        row = checks.integer("row", row, 0, self.num_rows - 1)
        self._check_whole("frame")
        _, positions = grid_of(self._scenario.grid_size)
        drones, state = self._cells[row], self._state
        missing, persons = state.missing[:, row], state.person_cells[:, row]
        finders, find_cells = state.finds[..., row]
        finders %= len(drones)
        x, y = self._now.forecasts.drift[:, row].tolist()
        return Frame(
            matrix=self.matrices_of(self._rows[row : row + 1])[0],
            drones=tuple(positions[cell] for cell in drones.tolist()),
            searching=tuple(self.searching[row].tolist()),
            persons=tuple(
                positions[cell] for cell in np.where(missing, persons, find_cells).tolist()
            ),
            found_by=tuple(
                None if lost else drone
                for lost, drone in zip(missing.tolist(), finders.tolist(), strict=True)
            ),
            step=int(self._state.step[row]),
            timestep_limit=self._scenario.timestep_limit,
            vector=(x, y),
            ending=Ending(ending) if (ending := self._endings[row]) else None,
        )

    def write_matrices(self, out: Singles) -> None:
        """Write the matrix of every row: float32, (E, N, N), C-contiguous, indexed [y, x].

        Raises:
            ResetNeeded: after an interrupted step or reset.
            TypeError: what is to receive them is no array.
            ValueError: it is of another shape, dtype or order, or read-only.
        """
        self._check_receiver(out)
        self._check_whole("write_matrices")
        self._state.write_matrices(out)

    def _check_receiver(self, matrices: Singles) -> None:
        size = self._scenario.grid_size
        checks.receiver("matrices", matrices, (self.num_rows, size, size), np.float32)

    def matrices_of(self, rows: Ints) -> Singles:
        """The matrices of some rows: float32, (n, N, N), indexed [y, x]; a new array.

        Args:
            rows: their numbers, in rising order.

        Raises:
            ResetNeeded: after an interrupted step or reset.
            TypeError, ValueError: these are not numbers of rows, or not in rising order.
        """
        rows = checked_rows(rows, self.num_rows, rising=True)
        self._check_whole("matrices_of")
        return self._state.matrices(rows)

    def probabilities(self, rows: Ints, cells: Ints) -> Singles:
        """What the matrices of some rows say of a cell of each: float32, (n,).

        Args:
            rows: their numbers, in rising order; a row may come several times.
            cells: y * N + x, shape (n,).

        Raises:
            ResetNeeded: after an interrupted step or reset.
            TypeError, ValueError: these are not numbers of rows and cells, or the rows are
                not in rising order.
        """
        self._check_whole("probabilities")
        rows = checked_rows(rows, self.num_rows, rising=True, repeated=True)
        what = f"integers from 0 to {self._scenario.grid_size**2 - 1}, one for each of the rows"
        places = checks.array("cells", cells, what)
        if places.dtype.kind not in "iu" and places.size:
            raise TypeError(f"cells must be {what}, got {places.dtype}")
        if places.shape != rows.shape:
            raise ValueError(f"cells must be {what}, got shape {places.shape}")
        wrong = places[(places < 0) | (places >= self._scenario.grid_size**2)]
        if wrong.size:
            raise ValueError(f"cells must be {what}, got {wrong[0]}")
        return self._state.shown(rows, places.astype(np.int64))

    @property
    def table(self) -> Singles:
        """The table of matrices, which all rows share: float32, (entries, N, N); read-only.

        A copy of the one that the batch uses. It fills up as episodes go on: entries that
        `table_index` has named stay as they are. A reset with parameters given makes
        another table.

        Raises:
            ValueError: matrices depend on what happened, or do not fit into a table.
        """
        return self._table().matrices

    @property
    def table_index(self) -> Ints:
        """Which entry of `table` is the matrix of each row: int64, (E,); a new array."""
        place: Ints = self._table().entries[0]
        return place.copy()

    def _table(self) -> TabulatedForecasts:
        forecasts, scenario = self._state.forecasts, self._scenario
        if scenario.bayesian_update or len(scenario.person_initial_position) > 1:
            raise ValueError(
                "with bayesian_update or several persons there is no table of matrices"
            )
        if not isinstance(forecasts, TabulatedForecasts):
            raise ValueError(
                "there is no table of matrices: the forecasts are too many, or sampled"
            )
        return forecasts


def _positions(grid_size: int) -> NDArray[np.int64]:
    """The (x, y) of every cell, two int32 seen as one int64, so that one look-up gives both."""
    y, x = np.divmod(np.arange(grid_size**2, dtype=np.int32), grid_size)
    pairs: Ints = np.stack([x, y], axis=1).astype(np.int32).view(np.int64).reshape(-1)
    return pairs
