"""The environment in PettingZoo's parallel form."""

from __future__ import annotations

import warnings
from collections.abc import Mapping, Sequence
from typing import Any, ClassVar

import numpy as np
from numpy.typing import ArrayLike, NDArray
from pettingzoo import AECEnv
from pettingzoo.utils.conversions import parallel_to_aec_wrapper
from pettingzoo.utils.wrappers import AssertOutOfBoundsWrapper, OrderEnforcingWrapper

from DroneSwarmSearch._internal import checks
from DroneSwarmSearch._internal.errors import ResetNeeded
from DroneSwarmSearch._internal.streams import Streams
from DroneSwarmSearch.core.actions import read_actions
from DroneSwarmSearch.core.drones import Drones
from DroneSwarmSearch.core.frame import Frame
from DroneSwarmSearch.core.grid import Grid
from DroneSwarmSearch.core.mappings import Infos, Rewards, Start
from DroneSwarmSearch.core.observations import (
    Observation,
    SearchSpaces,
    Snapshot,
    observe,
    state_planes,
)
from DroneSwarmSearch.core.radio import links_of
from DroneSwarmSearch.core.rules import Ending, RewardScheme
from DroneSwarmSearch.core.scenario import Scenario, resolve_scenario
from DroneSwarmSearch.core.world import WorldState
from DroneSwarmSearch.persons.person import Person
from DroneSwarmSearch.rendering.display import Display
from DroneSwarmSearch.rendering.palette import PALETTES, Look

__all__ = ["DroneSwarmSearch", "ResetNeeded", "env", "parallel_env"]

_OPTIONS = ("drones_positions", "vector", "person_initial_position", "persons")


def parallel_env(**kwargs: Any) -> DroneSwarmSearch:
    """The environment in PettingZoo's parallel form; takes `DroneSwarmSearch`'s arguments."""
    return DroneSwarmSearch(**kwargs)


def env(**kwargs: Any) -> AECEnv[str, Observation, int | None]:
    """The environment in PettingZoo's AEC form; takes `DroneSwarmSearch`'s arguments."""
    turn_based = parallel_to_aec_wrapper(DroneSwarmSearch(**kwargs))
    return OrderEnforcingWrapper(AssertOutOfBoundsWrapper(turn_based))


class DroneSwarmSearch(SearchSpaces):
    """Drones search a grid at sea for drifting shipwrecked persons.

    ## Actions
    `Discrete(6)`, see `rules.Action`: 0 left, 1 right, 2 up, 3 down (y increases downward),
    4 search the cell, 5 idle. Every drone needs an action in every step.

    ## Observations
    `{"observation": ((x, y), matrix)}` for each drone: its cell as Python ints, and the
    probability matrix, float32 of shape (grid_size, grid_size), indexed [y, x], which sums
    to 1. All drones share one matrix per step; it is read-only and never changes later. With
    several persons, it is the mean over those still missing. `state()` returns the full
    state, for centralised critics.

    With `radio_range`, each drone has a matrix of its own: what follows from its own searches and
    finds and those that it has heard. The infos and the end of the episode say what all drones
    together know, so policies must not use them.

    ## Rewards and endings
    See the table in `rules`. At the end of an episode, terminations and truncations are True
    for every drone, and `agents` is empty. `rewards["total_reward"]` is the sum over the
    drones; it is not listed as a key.

    ## Infos
    `infos[drone]["Found"]` is True once any drone has found a person.
    `infos[drone]["is_success"]` is True in the step that ends the episode with success: all
    persons have been found, or the coverage mission is complete. `infos` also answers look-ups
    of the following names, which are not listed as keys:

    - "Found", "is_success": the same as for each drone;
    - "persons_found": for each person, whether the person has been found, a tuple of bool;
    - "ending": the `Ending` of the episode, or None;
    - "step": completed steps;
    - "probability_of_success": the cumulative probability of success (POS) of all searches so
      far, the mean over persons; each drone's info has it too. Only with `bayesian_update`,
      `RewardScheme.expected()` or the coverage mission.

    ## Randomness
    Start, drift and detections draw from their own random streams: for one seed, the persons'
    drift does not depend on the drones' actions, in this episode and the following ones. The
    environment neither reads nor changes global random states.

    Args:
        grid_size: see `Scenario` for this and the other parameters of the search: `n_drones`,
            `vector`, `person_initial_position`, `disperse_constant`, `timestep_limit`,
            `probability_of_detection`, `bayesian_update`, `reward_scheme`, `persons`, `mission`,
            `shared_drift`, `crash`, `radio_range`, `search_in_flight`.
        render_mode: "human" (a window), "ansi" (`render` returns text), "rgb_array"
            (`render` returns a picture) or None.
        render_grid: draw lines between the cells.
        render_gradient: colour the cells smoothly, else in three steps.
        scenario: all parameters of the search, instead of these arguments.
        palette: the colours of the map: "sea" (pale to deep blue) or "classic" (dark red,
            yellow, bright green, as in the 2023 package).
        render_drone: the number of the drone whose map is drawn; None for that of all drones
            together. They differ with a `radio_range` only.

    Raises:
        TypeError: an argument is of the wrong type.
        ValueError: an argument is out of its limits, or is given together with a scenario
            or `persons`.
    """

    metadata: ClassVar[dict[str, Any]] = {
        "name": "drone_swarm_search_v0",
        "render_modes": ["human", "ansi", "rgb_array"],
        "render_fps": 10,
        "is_parallelizable": True,
    }

    def __init__(
        self,
        grid_size: int = 7,
        render_mode: str | None = "ansi",
        render_grid: bool = False,
        render_gradient: bool = True,
        n_drones: int = 1,
        vector: ArrayLike = (-0.5, -0.5),
        person_initial_position: ArrayLike = (0, 0),
        disperse_constant: float = 10,
        timestep_limit: int = 100,
        *,
        probability_of_detection: float | Sequence[float] = 1.0,
        bayesian_update: bool = False,
        reward_scheme: RewardScheme = RewardScheme(),  # noqa: B008 (frozen)
        persons: Sequence[Person] | Person | None = None,
        mission: str = "rescue",
        shared_drift: bool = False,
        crash: str = "end",
        radio_range: float | None = None,
        search_in_flight: bool = False,
        scenario: Scenario | None = None,
        palette: str = "sea",
        render_drone: int | None = None,
    ) -> None:
        super().__init__()
        self._scenario = resolve_scenario(
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
            shared_drift=shared_drift,
            crash=crash,
            radio_range=radio_range,
            search_in_flight=search_in_flight,
        )
        modes = (*self.metadata["render_modes"], None)
        self.render_mode = checks.choice("render_mode", render_mode, modes)
        self.render_grid = checks.boolean("render_grid", render_grid)
        self.render_gradient = checks.boolean("render_gradient", render_gradient)
        checks.choice("palette", palette, tuple(PALETTES))
        self.palette = palette
        self.render_drone = render_drone
        if render_drone is not None:
            last = self._scenario.n_drones - 1
            self.render_drone = checks.integer("render_drone", render_drone, 0, last)
        look = Look(render_grid, render_gradient, palette)
        self._display = Display(self.grid_size, look, fps=self.metadata["render_fps"])

        self.possible_agents = [f"drone{i}" for i in range(self.n_drones)]
        self.agents: list[str] = []
        self._names = tuple(self.possible_agents)
        self._grid = Grid.of(self.grid_size)
        self._flags = [dict.fromkeys(self._names, value) for value in (False, True)]
        self._streams: Streams | None = None
        self._episode = 0  # episodes since the seed

        # The episode, see `reset`.
        self._search: Scenario | None = None  # its parameters
        self._world: WorldState
        self._drones = Drones(self._names, self._scenario)
        self._ending: Ending | None = None

    @classmethod
    def example(cls, **changes: Any) -> DroneSwarmSearch:
        """A small search for first experiments: 15 x 15 cells, three drones, 60 steps.

        Drones that act at random hardly ever find the person. `GreedyPolicy` does in 89% of the
        episodes, and in 95% with `bayesian_update=True`. `changes` replace its arguments.
        """
        example = {"grid_size": 15, "n_drones": 3, "timestep_limit": 60, "vector": (0.08, 0.05)}
        start = {"person_initial_position": (5, 5), "disperse_constant": 0.6}
        return cls(**{**example, **start, **changes})

    def reset(
        self,
        seed: int | None = None,
        options: Mapping[str, Any] | None = None,
        *,
        drones_positions: ArrayLike | None = None,
        vector: ArrayLike | None = None,
    ) -> Start[Observation]:
        """Begin an episode.

        Args:
            seed: an integer >= 0 that determines the episode and those that follow it. Without
                a seed, the random streams continue.
            options: may hold "drones_positions" and "vector", as below, and
                "person_initial_position" or "persons", as in the constructor, for this
                episode only. Other names cause a warning.
            drones_positions: a cell (x, y) for each drone, for this episode only; different ones
                unless drones pass each other (`crash`).
                By default, the drones stand from left to right from (0, 0), row by row.
                Overrides the option.
            vector: drift in cells per step, (x, y), for this episode and later ones.
                Overrides the option. Not with `persons`, which have their own.

        Returns:
            The observations and the infos of all drones, as a tuple that also answers the
            drones' names with their observations, as the 2023 package's `reset` did.

        Raises:
            TypeError: an argument is of the wrong type.
            ValueError: an argument is out of its limits. Errors leave the environment unchanged.
        """
        if seed is not None:
            seed = checks.integer("seed", seed, 0)
        given = {} if options is None else checks.known_options(options, _OPTIONS, stacklevel=2)
        for name, value in (("drones_positions", drones_positions), ("vector", vector)):
            if value is not None:
                given[name] = value
        scenario, search, cells = self._resolved(given)
        if self.render_mode == "human":
            self._display.open()

        # All arguments are valid; the state changes from here on. There are no agents until
        # the new state is complete: after an interrupt, the environment needs a reset.
        self.agents = []
        self._ending = None
        if search is not self._search:
            self._search = None
            self._world = WorldState(search)
            self._search = search
        self._scenario = scenario
        self._episode += 1
        if seed is not None or self._streams is None:
            self._streams = Streams.from_seed(seed)
            self._episode = 0
        self._world.start(self._streams, self._episode)
        self._drones.start(cells)
        self.agents = list(self._names)
        if self.render_mode == "human":
            self._display.show(self.frame(self.render_drone))
        facts = (None, self._world.missing, self._world.persons, 0, self._world.success)
        observed = observe(
            self._names,
            cells,
            self._grid.positions,
            self._world.matrices,
            found=False,
            facts=facts,
        )
        return Start(observed)

    def _resolved(self, given: dict[str, Any]) -> tuple[Scenario, Scenario, list[int]]:
        """The parameters of all later episodes and of this one, and the drones' cells."""
        cells = list(range(self.n_drones))
        positions = given.pop("drones_positions", None)
        scenario = self._scenario
        if "vector" in given:
            scenario = scenario.replace(vector=given["vector"])
        search = scenario.replace(**given) if given.keys() - {"vector"} else scenario
        if positions is not None:
            cells = scenario.drone_cells(positions)
        return scenario, search, cells

    def step(
        self, actions: Mapping[str, int]
    ) -> tuple[dict[str, Observation], Rewards, dict[str, bool], dict[str, bool], Infos]:
        """Let every drone act once.

        Args:
            actions: an action, 0 to 5, for each drone.

        Returns:
            The observations, rewards, terminations, truncations and infos of all drones.

        Raises:
            ResetNeeded: no episode is running: it has not begun, has ended or was interrupted.
            TypeError: `actions` is not a mapping, or an action is not an integer.
            ValueError: an action is missing, out of range, or for an unknown drone. Errors
                leave the environment unchanged.
        """
        if not self.agents:
            raise ResetNeeded(
                "step: no episode is running (it has not begun, has ended or was interrupted); "
                "call reset() first"
            )
        drones = self._drones
        world = self._world
        # 1. All drones move or search.
        chosen, targets = read_actions(actions, self._names, self._grid.neighbours, drones.cells)
        # There are no agents until the step is complete, see `reset`.
        agents = self.agents
        self.agents = []
        # 2. Outcomes, rewards and the ending.
        rewards, ending = drones.resolve(chosen, targets, world)
        # 3. The persons and the matrix drift.
        world.advance(drones.heard)
        self._ending = ending
        if ending is None:
            self.agents = agents
        flags = self._flags[ending is not None]
        # 4. The drones observe the new state.
        if self.render_mode == "human":
            self._display.show(self.frame(self.render_drone))
        facts = (ending, world.missing, world.persons, world.step, world.success)
        observations, infos = observe(
            self._names,
            drones.cells,
            self._grid.positions,
            world.matrices,
            found=bool(drones.finders),
            facts=facts,
        )
        return observations, Rewards(rewards), flags.copy(), flags.copy(), infos

    # The rest of PettingZoo's API.

    def render(self) -> Any:
        """Render the current state as `render_mode` says.

        Returns:
            "ansi": text. "rgb_array": uint8, shape (H, W, 3). "human": None; the window
            shows the state. None: None, with a warning.

        Raises:
            ResetNeeded: before the first `reset`.
            RuntimeError: "human", and no window can be opened.
        """
        if self.render_mode is None:
            warnings.warn("render() does nothing without a render_mode", stacklevel=2)
            return None
        return self._display.render(self.frame(self.render_drone), self.render_mode)

    def _repr_png_(self) -> bytes | None:
        """The current state as a picture for notebooks; None before the first `reset`."""
        try:
            return self._display.png(self.frame(self.render_drone))
        except ResetNeeded:
            return None

    def close(self) -> None:
        """Close the window, if there is one; may be called repeatedly."""
        self._display.close()

    def state(self) -> NDArray[np.float32]:
        """The full state for a centralised critic: float32, (3, N, N), indexed [plane, y, x].

        The matrix, the number of drones and the number of missing persons in each cell.

        Raises:
            ResetNeeded: before the first `reset`.
        """
        now = self.snapshot()
        world = self._world
        missing = [world.person_cell(person) for person in world.missing if world.is_rescue]
        persons = np.array([missing], np.int64)
        planes = state_planes(now.matrix[None], np.array([now.cells]), persons, persons >= 0)
        state: NDArray[np.float32] = planes[0]
        return state

    # Beyond PettingZoo's API.

    def get_agents(self) -> list[str]:
        """The names of all drones, also between episodes."""
        return list(self._names)

    @property
    def scenario(self) -> Scenario:
        """The parameters of the current episode; before the first `reset`, of the constructor."""
        return self._scenario if self._search is None else self._search

    def frame(self, drone: int | None = None) -> Frame:
        """The current state as data for pictures, including the persons.

        Args:
            drone: the number of the drone whose map to show; by default, the map of all drones
                together. They are the same without a `radio_range`.

        Raises:
            ResetNeeded: before the first `reset`, and after an interrupted step or reset.
            TypeError: `drone` is not an integer.
            ValueError: there is no such drone.
        """
        now = self.snapshot()
        world = self._world
        known = world.known
        matrix = now.matrix
        if drone is not None:
            drone = checks.integer("drone", drone, 0, self.n_drones - 1)
            matrix = now.matrices[drone]
            known = world.known_by[drone] if world.known_by else known
        positions = self._grid.positions
        finds = world.finds
        drones = self._drones
        persons = world.persons if world.is_rescue else ()
        person_cells = (
            finds[person][1] if person in finds else world.person_cell(person) for person in persons
        )
        return Frame(
            matrix=matrix,
            drones=tuple(positions[cell] for cell in now.cells),
            searching=tuple(drone in drones.searching for drone in range(self.n_drones)),
            persons=tuple(positions[cell] for cell in person_cells),
            found_by=tuple(finds.get(person, (None, 0))[0] for person in persons),
            step=world.step,
            timestep_limit=self.timestep_limit,
            vector=self.scenario.mean_vector,
            ending=self._ending,
            hypotheses=known.hypotheses(),
            probability_of_success=world.success,
            prior=known.prior(),
            trails=tuple(tuple(positions[cell] for cell in trail) for trail in drones.trails()),
            searched=tuple((*positions[cell], age) for cell, age in drones.recent_searches()),
            total_return=sum(drones.returns),
            shared_drift=self.scenario.shared_drift,
            viewer=drone,
            links=None if now.heard is None else links_of(now.heard),
        )

    def snapshot(self) -> Snapshot:
        """What wrappers need of the current state, without the persons.

        Raises:
            ResetNeeded: before the first `reset`, and after an interrupted step or reset.
        """
        if not self.agents and self._ending is None:
            raise ResetNeeded("no episode has begun, or it was interrupted; call reset() first")
        return Snapshot(
            cells=self._drones.cells,
            matrix=self._world.matrix,
            step=self._world.step,
            ending=self._ending,
            matrices=self._world.matrices,
            heard=self._drones.heard,
            last_heard=self._drones.last_heard,
        )
