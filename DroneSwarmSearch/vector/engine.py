"""The batch: many searches stepped together, arrays in and arrays out.

A row whose episode has ended begins its next one in place of the following step.
"""

from __future__ import annotations

import dataclasses
from collections.abc import Callable, Mapping, Sequence
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from DroneSwarmSearch._internal import checks
from DroneSwarmSearch._internal.arrays import Flags, Floats, Ints, Singles, Words
from DroneSwarmSearch._internal.errors import ResetNeeded
from DroneSwarmSearch._internal.signatures import shows_keywords_of
from DroneSwarmSearch._internal.streams import GOLDEN, mixed, stream_keys, uniforms
from DroneSwarmSearch.core import rules
from DroneSwarmSearch.core.actions import checked_actions
from DroneSwarmSearch.core.frame import Frame
from DroneSwarmSearch.core.grid import OFF_GRID, Grid
from DroneSwarmSearch.core.observations import state_planes
from DroneSwarmSearch.core.radio import LastHeard, hearing, links_of
from DroneSwarmSearch.core.rules import Action, Ending
from DroneSwarmSearch.core.scenario import REPLACED, Scenario, resolve_scenario
from DroneSwarmSearch.drift.belief import mean_forecast
from DroneSwarmSearch.persons.person import Person
from DroneSwarmSearch.vector.catalogue import Catalogue
from DroneSwarmSearch.vector.world import BatchState

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

_CATALOGUE_SIZE = 256  # the searches that a sampler draws at a time
_USES = 4  # the episodes for each of them, on average, until others are drawn


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
        finds_last: False simulates searches that never find a search's last missing person,
            although they may find the others.

    Attributes:
        num_rows: the number of searches.
        cells: every drone's cell, y * N + x: int64, (E, n_drones). Steps and resets replace this
            array and those below; a caller may keep them.
        searching: which drones searched in the last step: bool, (E, n_drones).
        rewards: of the last step: float64, (E, n_drones).
        endings: why the last step ended episodes, each an `Ending`, or 0: int8, (E,).
        ended: rows that begin an episode in place of the next step: bool, (E,).
        heard: which drone heard which in the last step, see `radio.hearing`: bool,
            (E, n_drones, n_drones); all do without a `radio_range`.
        last_heard: where each drone last heard each other one.

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
        finds_last: bool = True,
        **parameters: Any,
    ) -> None:
        self.num_rows = rows = checks.integer("num_rows", num_rows, 1)
        checks.boolean("finds_last", finds_last)
        if sampler is not None and situations is not None:
            raise ValueError("sampler cannot be given together with situations")
        self._scenario = scenario = resolve_scenario(scenario, **parameters)
        scenarios = [scenario]
        if situations is not None:
            scenarios = _scenarios_of(scenario, situations)
            # An error if the scenario has other values of what each Person has.
            dataclasses.replace(scenario, persons=scenarios[0].persons)
        n = scenario.n_drones
        self._rules = scenario.rules
        self._radio_range = scenario.radio_range
        self._size = scenario.grid_size
        self._sampler = sampler
        self._rng = np.random.default_rng()  # of the sampler
        self._unused = 0  # episodes until the sampler draws other searches
        self._situation: Ints | None = None
        self._start_cells: Ints = np.tile(np.arange(n), (rows, 1))
        if drones_positions is not None:
            self._start_cells = scenario.drone_cells_of_rows(drones_positions, rows)

        self._rows = np.arange(rows)
        self._row_of = self._rows.repeat(n)  # of each drone
        grid = Grid.of(scenario.grid_size)
        self._positions = grid.coordinates
        self._neighbours = grid.targets
        self._counters: Words = np.zeros((4, rows), np.uint64)  # stream keys plus episodes
        self._seeded = np.zeros(rows, np.bool_)
        self._changing = False  # stays True after an interrupted step or reset
        self._world = BatchState(Catalogue(scenarios), rows, finds_last)
        if situation is not None:
            self._situation = checks.integers("situation", situation, rows, 0, len(scenarios) - 1)
            self._world.situation[:] = self._situation
        self.cells: Ints = np.zeros((rows, n), np.int64)
        self.searching: Flags = np.zeros((rows, n), np.bool_)
        self.rewards: Floats = np.zeros((rows, n))
        self.endings: NDArray[np.int8] = np.zeros(rows, np.int8)
        self.ended: Flags = np.ones(rows, np.bool_)
        self.heard: Flags = np.ones((rows, n, n), np.bool_)
        self.last_heard = LastHeard.at_start(self.cells)
        self._returns: Floats = np.zeros((rows, n))  # in this episode
        self._finders: Flags = np.zeros((rows, n), np.bool_)  # in this episode

    # Episodes.

    def reset(
        self,
        seeds: Sequence[int | None] | None = None,
        rows: ArrayLike | None = None,
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
            IndexError: there is no such row.
            TypeError: a value is of the wrong type.
            ValueError: a value is out of its limits. After any error of the input the batch is
                unchanged.
        """
        which = self._rows if rows is None else self._rows[np.asarray(rows)]
        if self._changing and len(which) < self.num_rows:
            raise ResetNeeded("reset: a step or reset was interrupted; reset all searches")
        given = [None] * len(which) if seeds is None else checks.seeds("seeds", seeds)
        if len(given) != len(which):
            raise ValueError(f"seeds must be {len(which)}, one for each row, got {len(given)}")
        counters = self._counters[:, which] + GOLDEN
        # of the sampler
        rng = self._rng
        is_due = self._unused <= 0
        for index, (row, seed) in enumerate(zip(which.tolist(), given, strict=True)):
            if seed is not None or not self._seeded[row]:
                counters[:, index] = stream_keys(seed) + GOLDEN
            if seed is not None and row == 0:
                rng = np.random.default_rng(seed)
                is_due = True
        catalogue = None
        if situations is not None:
            if self._sampler is not None:
                raise ValueError("situations cannot be given together with a sampler")
            scenarios = _scenarios_of(self._scenario, situations, len(self._world.missing))
            catalogue = self._world.extended(scenarios, which)
        elif is_due:
            catalogue = self._sampled(which, rng)
        chosen = self._situation if situation is None else situation
        if chosen is not None:
            choices = (catalogue or self._world.catalogue).choices
            chosen = checks.integers("situation", chosen, self.num_rows, 0, choices - 1)[which]
        cells = None
        if drones_positions is not None:
            cells = self._scenario.drone_cells_of_rows(drones_positions, self.num_rows)[which]

        # The input is valid: from here on the batch changes.
        self._changing = True
        for name in ("cells", "searching", "rewards", "endings", "ended", "heard"):
            setattr(self, name, getattr(self, name).copy())  # the caller may keep the last ones
        self.last_heard = self.last_heard.copy()
        self._rng = rng
        self._begin(which, counters, catalogue, chosen, cells)
        self._changing = False

    def _sampled(self, starting: Ints, rng: np.random.Generator) -> Catalogue | None:
        """New searches from the sampler, if there is one; an error if they are invalid."""
        if self._sampler is None:
            return None
        scenarios = []
        cells = []
        for _ in range(_CATALOGUE_SIZE):
            drawn = self._sampler(rng)
            changes = checks.known_keys("a search of sampler", drawn, _SAMPLED, ValueError)
            positions = changes.pop("drones_positions", None)
            if positions is not None:
                cells.append(self._scenario.drone_cells(positions))
            scenarios.append(self._scenario.replace(**changes))
            persons = len(self._world.missing)
            drawn_persons = len(scenarios[-1].persons_to_find)
            if drawn_persons != persons:
                raise ValueError(
                    f"sampler must return as many persons as the environment has, {persons}, got "
                    f"{drawn_persons}"
                )
        if cells and len(cells) < len(scenarios):
            raise ValueError("sampler must return drones_positions for every search, or for none")
        return self._world.extended(scenarios, starting, np.array(cells) if cells else None)

    def _begin(
        self,
        rows: Ints,
        counters: Words,
        catalogue: Catalogue | None,
        situation: Ints | None = None,
        cells: Ints | None = None,
    ) -> None:
        """Begin the episodes of some rows, with new counters of their random streams: (4, n).

        By default, the catalogue stays, `situation` is drawn, and `cells` are the usual ones.
        """
        if catalogue is not None:
            self._world.use(catalogue, rows)
            self._unused = catalogue.choices * _USES
        catalogue = self._world.catalogue
        self._unused -= len(rows)
        self._counters[:, rows] = counters
        self._seeded[rows] = True
        keys = mixed(counters)
        if situation is None and catalogue.choices == 1:
            situation = np.zeros_like(rows)
        elif situation is None:
            draws = uniforms(keys[2], np.zeros(1, np.uint64))
            situation = (draws * catalogue.choices).astype(np.int64)
        if cells is None:
            by_search = catalogue.cells
            cells = self._start_cells[rows] if by_search is None else by_search[situation]
        self._world.begin(rows, keys, situation)
        self.cells[rows] = cells
        if self._radio_range is not None:
            self.heard[rows] = hearing(cells, self._size, self._radio_range)
            self.last_heard.restart(rows, self.cells)
        self.searching[rows] = self._finders[rows] = False
        self.rewards[rows] = self._returns[rows] = 0.0
        self.endings[rows] = 0
        self.ended[rows] = False

    # A step.

    def step(self, actions: ArrayLike, *, autoreset: bool = True) -> None:
        """Let every drone act once; rows that have ended begin their next episodes instead.

        Args:
            actions: integers from 0 to 5, see `rules.Action`; shape (E, n_drones).
            autoreset: False makes rows that have ended an error.

        Raises:
            ResetNeeded: before the first `reset`, after an interrupted step or reset, or for
                rows that have ended if `autoreset` is False.
            TypeError: the actions are not integers.
            ValueError: an action is out of range, or their shape is wrong. After these errors the
                batch is unchanged.
        """
        beginning = self.ended.nonzero()[0]
        self._check_episodes(beginning, autoreset=autoreset)
        chosen = checked_actions(actions, self.cells.shape, np.int64)
        catalogue = None
        if beginning.size and self._unused <= 0:
            catalogue = self._sampled(beginning, self._rng)

        # The input is valid: from here on the batch changes.
        self._changing = True
        chosen[beginning] = Action.IDLE.value
        world = self._world

        # 1. All drones move or search.
        targets, arrived = self._moved(chosen)
        self.searching = self._searching(chosen)
        self.searching[beginning] = False
        searches = self.searching.reshape(-1).nonzero()[0]  # by drone: row * n_drones + drone
        rows = self._row_of.take(searches)
        cells = arrived.take(searches)

        # 2. The rules decide outcomes, rewards and endings.
        told = world.tell(rows, searches, self._hearing(arrived))
        observed = world.observed(rows, cells)
        found = world.search(rows, cells, searches, told)
        events = rules.BatchEvents(
            searching=self.searching,
            targets=targets,
            observed=observed,
            found=found,
            found_before=self._finders,
            returns=self._returns,
            steps_before=world.step,
            all_found=world.all_found(self._row_of.take(found)),
            covered=world.covered(),
        )
        self.rewards, self.endings = rules.outcomes(self._rules, events)
        self._finders.reshape(-1)[found] = True
        self._returns += self.rewards
        self.ended = self.endings != 0
        self.cells = arrived

        # 3. The clock advances; rows that had ended begin instead.
        world.advance()
        if beginning.size:
            self._begin(beginning, self._counters[:, beginning] + GOLDEN, catalogue)
        world.catalogue.forecasts.reach(int(world.step.max()))
        self._changing = False

    def _moved(self, actions: Ints) -> tuple[Ints, Ints]:
        """The targets of actions, see `rules.BatchEvents`, and the cells where drones arrive."""
        targets = self._neighbours.take(self.cells * len(Action) + actions)
        if self._rules.crash == rules.END:
            return targets, np.where(targets == OFF_GRID, self.cells, targets)
        arrived = rules.arrivals_of_rows(self.cells, targets, self._rules.crash)
        return arrived, arrived

    def _searching(self, actions: Ints) -> Flags:
        """Which drones search; a new array."""
        if self._rules.search_in_flight:
            return np.ones(actions.shape, np.bool_)
        searching: Flags = actions == Action.SEARCH.value
        return searching

    def searches_of(self, actions: Ints) -> tuple[Ints, Ints]:
        """The searches that some actions, (E, n_drones), would make: their rows and cells.

        In ascending order of rows, and within a row of drones. Rows that have ended count, too.
        """
        _, arrived = self._moved(actions)
        rows, drones = self._searching(actions).nonzero()
        return rows, arrived[rows, drones]

    def _hearing(self, arrived: Ints) -> Flags | None:
        """Let the drones hear those in range, in the cells where they arrive: who hears whom."""
        if self._radio_range is None:
            return None
        self.heard = hearing(arrived, self._size, self._radio_range)
        self.last_heard = self.last_heard.after(arrived, self.heard)
        return self.heard

    def _check_episodes(self, ended: Ints, *, autoreset: bool) -> None:
        """Raise `ResetNeeded` unless all rows have an episode, or may begin one."""
        if self._changing:
            raise ResetNeeded("step: a step or reset was interrupted; reset all searches first")
        if not self._seeded.all():
            raise ResetNeeded("step: not all episodes have begun; call reset() first")
        if ended.size and not autoreset:
            raise ResetNeeded(
                f"step: the episodes of searches {ended.tolist()} have ended; reset them first, in "
                "a vector environment with options={'reset_mask': ...}"
            )

    # Parameters.

    def scenario_of(self, row: int) -> Scenario:
        """The parameters of one search in its current episode, its persons included."""
        return self._world.catalogue.scenarios[int(self._world.situation[row])]

    @property
    def observers(self) -> int:
        """How many matrices the drones of a row observe: n_drones with a `radio_range`, else 1."""
        return 1 if self._radio_range is None else self.cells.shape[1]

    @property
    def crash(self) -> str:
        """What happens to drones that crash, see `Scenario`."""
        return self._rules.crash

    @property
    def situation(self) -> Ints:
        """The number of every row's situation in the catalogue: int64, (E,)."""
        return self._world.situation.copy()

    # The state.

    @property
    def steps(self) -> Ints:
        """Completed steps of every row: int64, (E,)."""
        return self._world.step.copy()

    @property
    def positions(self) -> NDArray[np.int32]:
        """Every drone's cell (x, y): int32, (E, n_drones, 2)."""
        return self._positions.take(self.cells, axis=0)

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
        return self._world.known.success()

    @property
    def probability_of_failure(self) -> Floats | None:
        """The probability that no search so far finds each person: float64, (E, persons).

        It means nothing for a person who has been found. None unless beliefs are kept, see
        `probability_of_success`.
        """
        failure = self._world.known.failure()
        return None if failure is None else failure.T.copy()

    def frame(self, row: int, drone: int | None = None) -> Frame:
        """Everything that a picture of one row shows, including the persons, but no trails.

        `drone`: the number of the drone whose map to show; by default, that of all together.
        """
        world = self._world
        scenario = self.scenario_of(row)
        positions = Grid.of(scenario.grid_size).positions
        missing = world.missing[:, row]
        ending = self.endings[row]
        finders, find_cells = world.finds[..., row]
        persons = np.where(missing, world.person_cells[:, row], find_cells)
        found_by = np.where(missing, -1, finders % scenario.n_drones)
        if scenario.mission == "coverage":  # it has no persons
            persons = found_by = persons[:0]
        models = scenario.forecasts()
        step = int(world.step[row])
        success = self.probability_of_success
        prior = None
        hypotheses = [tuple(model.weights.tolist()) for model in models]
        known = world.known
        who = known.of_rows(np.array([row]))
        if drone is not None:
            who = known.of_drones(np.array([row]))[[drone if known.observers > 1 else 0]]
        observer = int(who[0])
        shown = known.shown_mass(observer)
        if shown is not None:
            hypotheses = [
                model.hypotheses(
                    masses[: model.state_shape[0], : model.layer].reshape(model.state_shape)
                )
                for model, masses in zip(models, shown, strict=True)
            ]
            prior = mean_forecast(models, known.missing[:, observer].nonzero()[0].tolist(), step)
        return Frame(
            matrix=known.matrices(who)[0],
            drones=tuple(positions[cell] for cell in self.cells[row].tolist()),
            searching=tuple(self.searching[row].tolist()),
            persons=tuple(positions[cell] for cell in persons.tolist()),
            found_by=tuple(None if drone < 0 else drone for drone in found_by.tolist()),
            step=step,
            timestep_limit=scenario.timestep_limit,
            vector=scenario.mean_vector,
            ending=Ending(ending) if ending else None,
            hypotheses=tuple(hypotheses),
            probability_of_success=None if success is None else float(success[row]),
            prior=prior,
            total_return=sum(self._returns[row].tolist()),
            shared_drift=scenario.shared_drift,
            viewer=drone,
            links=None if scenario.radio_range is None else links_of(self.heard[row]),
        )

    # The matrices.

    def write_matrices(self, out: Singles) -> None:
        """Write the matrix of every row: float32, (E, N, N), indexed [y, x]."""
        self._world.known.write_matrices(out)

    def matrices_of(self, rows: ArrayLike) -> Singles:
        """The matrices of some rows: float32, (n, N, N), indexed [y, x]; or an IndexError."""
        known = self._world.known
        return known.matrices(known.of_rows(self._rows[np.asarray(rows)]))

    def matrices_by_drone(self, rows: ArrayLike | None = None) -> Singles:
        """The matrix that each drone of some rows observes: float32, (n, n_drones, N, N).

        By default of all rows. Without a `radio_range`, the second axis is 1: all observe the same.
        """
        known = self._world.known
        if rows is None:
            matrices = known.matrices_of_drones()
        else:
            matrices = known.matrices(known.of_drones(self._rows[np.asarray(rows)]))
        return matrices.reshape(-1, self.observers, self._size, self._size)

    def state_planes(self) -> Singles:
        """The full state of every row, see `DroneSwarmSearch.state`: float32, (E, 3, N, N)."""
        missing = self.missing
        if self._scenario.mission == "coverage":  # it has no persons
            missing[:] = False
        matrices = self.matrices_of(self._rows)
        return state_planes(matrices, self.cells, self.person_cells, missing)

    def probabilities(self, rows: ArrayLike, cells: ArrayLike) -> Singles:
        """The probabilities of one cell, y * N + x, in each of some rows' matrices: float32, (n,).

        A row may occur several times.
        """
        return self._world.known.probabilities(self._rows[np.asarray(rows)], np.asarray(cells))


def _scenarios_of(
    scenario: Scenario, situations: Situations, persons: int | None = None
) -> list[Scenario]:
    """The searches of some situations; `persons` is the number in each, if it is known."""
    what = "a sequence of situations, each a sequence of Person"
    given: list[Any] = checks.items("situations", situations, what)
    if not given:
        raise ValueError(f"situations must hold at least one situation, got {situations!r}")
    made = [scenario.replace(persons=situation) for situation in given]
    persons = persons or len(made[0].persons_to_find)
    for index, search in enumerate(made):
        if len(search.persons_to_find) != persons:
            raise ValueError(
                f"situations must all hold the same number of persons, {persons}, got "
                f"{len(search.persons_to_find)} in situations[{index}]"
            )
    return made
