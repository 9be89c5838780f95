"""The environment: checks, random streams, the order of a step, and the dicts.

A step goes through four phases, in this order:

1. all drones move or search at once, against the state they were shown;
2. `rules` decides outcomes, rewards and whether the episode ends;
3. the clock advances, the persons and the matrix drift;
4. the new state is observed.
"""

from __future__ import annotations

import warnings
from collections.abc import Mapping, Sequence
from typing import TYPE_CHECKING, Any, ClassVar

import gymnasium
import numpy as np
from numpy.typing import ArrayLike, NDArray
from pettingzoo import AECEnv, ParallelEnv
from pettingzoo.utils.wrappers import OrderEnforcingWrapper

from DroneSwarmSearch import rules
from DroneSwarmSearch._internal import checks
from DroneSwarmSearch._internal.actions import TurnBased, names_in_words, reader
from DroneSwarmSearch._internal.errors import ResetNeeded
from DroneSwarmSearch._internal.grid import grid_of
from DroneSwarmSearch._internal.mappings import Infos, Rewards, Start
from DroneSwarmSearch._internal.streams import Streams
from DroneSwarmSearch.observations import (
    Observation,
    observation_space,
    observe,
    state_planes,
    state_space,
)
from DroneSwarmSearch.rendering.frame import Frame
from DroneSwarmSearch.rendering.palette import PALETTES
from DroneSwarmSearch.rules import OFF_GRID, Action, Ending, RewardScheme
from DroneSwarmSearch.scenario import Scenario, scenario_of
from DroneSwarmSearch.world import WorldState

if TYPE_CHECKING:
    from DroneSwarmSearch.rendering.painter import Painter
    from DroneSwarmSearch.rendering.window import Window

__all__ = ["DroneSwarmSearch", "ResetNeeded", "env", "parallel_env"]

_SEARCH = int(Action.SEARCH)
_EXAMPLE: dict[str, Any] = {
    "grid_size": 15,
    "n_drones": 3,
    "vector": (0.15, 0.1),
    "person_initial_position": (6, 6),
    "disperse_constant": 3,
    "timestep_limit": 60,
}
_OPTIONS = ("drones_positions", "vector", "person_initial_position")


def parallel_env(**kwargs: Any) -> DroneSwarmSearch:
    """The environment in PettingZoo's parallel form; takes `DroneSwarmSearch`'s arguments."""
    return DroneSwarmSearch(**kwargs)


def env(**kwargs: Any) -> AECEnv[str, Observation, int | None]:
    """The environment in PettingZoo's AEC form; takes `DroneSwarmSearch`'s arguments."""
    return OrderEnforcingWrapper(TurnBased(DroneSwarmSearch(**kwargs)))


class DroneSwarmSearch(ParallelEnv[str, Observation, int]):
    """Drones search a grid at sea for shipwrecked persons who drift.

    ## Actions
    `Discrete(6)`, see `rules.Action`: 0 left, 1 right, 2 up, 3 down (y grows downward),
    4 search the cell, 5 idle. Every drone needs an action in every step.

    ## Observations
    `{"observation": ((x, y), matrix)}` for each drone: its own cell as Python ints, and
    the probability matrix, float32 of shape (grid_size, grid_size), indexed [y, x],
    summing to 1. All drones of a step share one matrix; it is read-only and never changes
    after it was handed out. With several persons it is the mean over those still missing.
    `state()` gives the whole truth, for centralised critics.

    ## Rewards and endings
    The table at the top of ``rules``. At the end both terminations and truncations are True
    for every drone, and `agents` is empty. `rewards["total_reward"]` is the sum over the
    drones; `infos["Found"]` and `infos[drone]["Found"]` turn True when a drone finds a
    person. Neither name is among the keys.

    ## Randomness
    The persons' drift and the detections draw from streams of their own, so that for one
    seed the sea is the same whatever the drones do, in that episode and in those that
    follow it. Global random states are neither read nor moved.

    Args:
        grid_size: cells along each side of the square grid; an integer of at least 2.
        render_mode: "human" (a window), "ansi" (`render` returns text; nothing is shown
            by itself), "rgb_array" (`render` returns a picture) or None.
        render_grid: draw lines between the cells.
        render_gradient: colour the cells smoothly; else in three steps.
        n_drones: from 1 to grid_size².
        vector: drift in cells per step, (x, y), y growing downward; finite. It stays
            until `reset` is given another.
        person_initial_position: a person's cell (x, y) at step 0, or several cells, one
            person each; the mission is then to find them all.
        disperse_constant: how quickly the persons may stray from the drift; at least 0.
        timestep_limit: the steps in an episode; at least 1.
        probability_of_detection: the chance that a search of the right cell finds the
            person, from 0 to 1; one number, or one for each person.
        bayesian_update: whether the matrix is the exact posterior given the searches
            made, or the drift alone.
        reward_scheme: the figures of the reward table.
        scenario: all of these but the render settings, in place of them.
        palette: the colours of the map: "classic" (dark red, yellow, bright green) or
            "sea" (pale to deep blue).

    Raises:
        TypeError: an argument is of the wrong type.
        ValueError: an argument is out of its limits, or given beside a scenario.
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
        scenario: Scenario | None = None,
        palette: str = "classic",
    ) -> None:
        parameters = {
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
        self._scenario = scenario_of(scenario, parameters)
        modes = (*self.metadata["render_modes"], None)
        self.render_mode = checks.choice("render_mode", render_mode, modes)
        self.render_grid = checks.boolean("render_grid", render_grid)
        self.render_gradient = checks.boolean("render_gradient", render_gradient)
        checks.choice("palette", palette, tuple(PALETTES))
        self.palette = palette
        self._painter: Painter | None = None
        self._window: Window | None = None

        n = self._scenario.n_drones
        self.possible_agents = [f"drone{i}" for i in range(n)]
        self.agents: list[str] = []
        self._names = tuple(self.possible_agents)
        self._read = reader(self._names)
        self._all_step = dict.fromkeys(self._names, self._scenario.reward_scheme.step)
        self._all_idle = bytes([Action.IDLE]) * n
        self._all_false = dict.fromkeys(self._names, False)
        self._all_true = dict.fromkeys(self._names, True)
        self._action_spaces: dict[str, gymnasium.spaces.Discrete] = {}
        self._observation_spaces: dict[str, gymnasium.spaces.Dict] = {}
        self._state_space: gymnasium.spaces.Box | None = None
        self._neighbours, self._positions = grid_of(self._scenario.grid_size)
        self._start_cells = list(range(n))
        self._last_step = self._scenario.timestep_limit - 1
        self._streams: Streams | None = None
        self._episode = 0  # since the seed

        # The episode; `reset` fills it in.
        self._search: Scenario | None = None
        self._world: WorldState
        self._cells: list[int] = []  # of the drones
        self._chosen = b""  # the actions of the last step
        self._ending: Ending | None = None
        self._found = False
        self._finders: set[int] = set()  # drones that have found somebody
        self._beyond_step: list[float] = []  # each drone's return less what `step` pays

    @classmethod
    def example(cls, **changes: Any) -> DroneSwarmSearch:
        """A small search to try things on.

        Three drones search 15 x 15 cells for 60 steps. None starts on the person's cell, and
        drones that act at random hardly ever find the person. `GreedyPolicy` finds the person
        in 67 % of the episodes, and in 74 % with `bayesian_update=True`.

        Args:
            changes: arguments of the constructor in place of the example's.
        """
        return cls(**{**_EXAMPLE, **changes})

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
            seed: an integer >= 0, from which the whole episode follows, whatever else
                runs in the process. Without one the random streams go on.
            options: may hold "drones_positions" and "vector", as below, and
                "person_initial_position", as in the constructor but for this episode
                alone. Unknown options are warned about.
            drones_positions: a cell (x, y) for each drone, no two alike, for this
                episode alone. Without them drones stand from left to right from (0, 0),
                row by row. Wins over the option.
            vector: drift in cells per step, (x, y), for this and later episodes. Wins
                over the option.

        Returns:
            The observations and the infos of every drone, as a tuple; it answers drones'
            names with their observations, for scripts that know nothing of infos.

        Raises:
            TypeError: an argument is of the wrong type.
            ValueError: an argument is out of its limits.
            RuntimeError: render_mode is "human" and no window can be opened. As with every
                error, the environment is as it was.
        """
        scenario = search = self._scenario
        cells = self._start_cells
        if seed is not None:
            seed = checks.integer("seed", seed, 0)
        person_initial_position = None
        if options is not None:
            options = checks.known_options(options, _OPTIONS, stacklevel=2)
            person_initial_position = options.get("person_initial_position")
            if drones_positions is None:
                drones_positions = options.get("drones_positions")
            if vector is None:
                vector = options.get("vector")
        if vector is not None:
            scenario = search = scenario.replace(vector=vector)
        if person_initial_position is not None:
            search = search.replace(person_initial_position=person_initial_position)
        if drones_positions is not None:
            cells = scenario.drone_cells(drones_positions)

        if self.render_mode == "human":
            self._get_window().open()

        # Everything is checked: from here on the environment changes. Until it is done there
        # is no episode, so that an interrupt leaves an environment that asks for a reset.
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
        matrix = self._world.begin(self._streams, self._episode)
        self._cells = cells
        self._chosen = self._all_idle
        self._found = False
        self._finders = set()
        self._beyond_step = [0.0] * len(cells)
        self.agents = list(self._names)
        if self.render_mode == "human":
            self._show()
        return Start(observe(self._names, cells, self._positions, matrix, self._found))

    def step(
        self, actions: Mapping[str, int]
    ) -> tuple[dict[str, Observation], Rewards, dict[str, bool], dict[str, bool], Infos]:
        """Let every drone act once.

        Args:
            actions: an action, 0 to 5, for each drone.

        Returns:
            Observations, rewards, terminations, truncations and infos of every drone.

        Raises:
            ResetNeeded: before the first `reset`, after the end of an episode, and after an
                exception (Ctrl-C, for example) interrupted a step or a reset.
            TypeError: `actions` is no mapping, or an action is no integer.
            ValueError: an action is missing, out of range, or for no drone. As with every
                error, the environment is as it was.
        """
        if not self.agents:
            raise ResetNeeded(
                "step: the episode is over, was interrupted or has not begun; call reset() first"
            )
        # 1. Every drone moves or searches.
        cells, world = self._cells, self._world
        chosen, targets = self._read(actions, self._neighbours, cells)
        # Without agents until the step is complete: if it is interrupted, a reset is needed.
        agents, self.agents = self.agents, []
        self._chosen = chosen

        # 2. Outcomes, rewards and the end; mostly the table's last line is all there is.
        rewards, ending = self._all_step, None
        crashed = targets is not cells and len({OFF_GRID, *targets}) <= len(targets)
        if crashed or _SEARCH in chosen or world.step == self._last_step:
            rewards = rewards.copy()
            targets, ending = self._judge(targets, crashed, rewards)
        self._cells = targets

        # 3. The clock advances, the persons and the matrix drift.
        matrix = world.advance()
        if ending is None:
            over = self._all_false
            self.agents = agents
        else:
            over = self._all_true
            self._ending = ending

        # 4. The new state is observed.
        if self.render_mode == "human":
            self._show()
        observations, infos = observe(self._names, targets, self._positions, matrix, self._found)
        return observations, Rewards(rewards), over.copy(), over.copy(), infos

    def render(self) -> Any:
        """Show or return the present state, as `render_mode` says.

        Returns:
            "ansi": the frame as text. "rgb_array": a picture, uint8, shape (H, W, 3).
            "human": None; the window is drawn. None: None, with a warning.

        Raises:
            ResetNeeded: before the first `reset`.
            RuntimeError: "human" where no window can be opened.
        """
        if self.render_mode is None:
            warnings.warn("render() does nothing without a render_mode", stacklevel=2)
            return None
        frame = self.frame()
        if self.render_mode == "ansi":
            from DroneSwarmSearch.rendering.text import render_text

            return render_text(frame)
        if self.render_mode == "rgb_array":
            return self._get_painter().pixels(frame)
        self._get_window().show(frame)
        return None

    def close(self) -> None:
        """Close the window, if there is one; may be called any number of times."""
        if self._window is not None:
            self._window.close()

    def state(self) -> NDArray[np.float32]:
        """The whole state for a centralised critic, persons included.

        Returns:
            float32, shape (3, grid_size, grid_size), indexed [plane, y, x]: the matrix,
            the number of drones and the number of missing persons in each cell.

        Raises:
            ResetNeeded: before the first `reset`.
        """
        frame = self.frame()
        missing = [
            cell for cell, found in zip(frame.persons, frame.found, strict=True) if not found
        ]
        return state_planes(frame.matrix, frame.drones, missing)

    @property
    def state_space(self) -> gymnasium.spaces.Box:
        """The space that `state()` lies in."""
        if self._state_space is None:
            self._state_space = state_space(self.grid_size, self.n_drones)
        return self._state_space

    def observation_space(self, agent: str) -> gymnasium.spaces.Dict:
        """The space of a drone's observations; the same object at every call."""
        space = self._observation_spaces.get(agent)
        if space is None:
            self._check_name(agent)
            space = self._observation_spaces[agent] = observation_space(self.grid_size)
        return space

    def action_space(self, agent: str) -> gymnasium.spaces.Discrete:
        """Discrete(6), see `rules.Action`; the same object at every call."""
        space = self._action_spaces.get(agent)
        if space is None:
            self._check_name(agent)
            space = self._action_spaces[agent] = gymnasium.spaces.Discrete(len(Action))
        return space

    @property
    def observation_spaces(self) -> dict[str, gymnasium.spaces.Dict]:
        """`observation_space` of every drone."""
        return {agent: self.observation_space(agent) for agent in self._names}

    @property
    def action_spaces(self) -> dict[str, gymnasium.spaces.Discrete]:
        """`action_space` of every drone."""
        return {agent: self.action_space(agent) for agent in self._names}

    # What the environment says of itself beyond PettingZoo's API.

    def get_agents(self) -> list[str]:
        """The names of all possible drones, whether an episode is running or not."""
        return list(self._names)

    @property
    def scenario(self) -> Scenario:
        """The parameters of the present episode, with what `reset` was given for it.

        Before the first `reset`, those of the constructor.
        """
        return self._scenario if self._search is None else self._search

    @property
    def grid_size(self) -> int:
        """Cells along each side of the grid."""
        return self._scenario.grid_size

    @property
    def n_drones(self) -> int:
        """The number of drones."""
        return self._scenario.n_drones

    @property
    def vector(self) -> tuple[float, float]:
        """Drift in cells per step, (x, y)."""
        return self._scenario.vector

    @property
    def timestep_limit(self) -> int:
        """The number of steps in an episode."""
        return self._scenario.timestep_limit

    def frame(self) -> Frame:
        """Everything a picture of the present state shows, the persons included.

        Raises:
            ResetNeeded: before the first `reset`, and after an interrupted step or reset.
        """
        if not self.agents and self._ending is None:
            raise ResetNeeded("no episode has begun, or it was interrupted; call reset() first")
        positions, world, finds = self._positions, self._world, self._world.finds
        cells = (
            finds[person][1] if person in finds else world.person_cell(person)
            for person in world.everybody
        )
        return Frame(
            matrix=world.matrix(),
            drones=tuple(positions[cell] for cell in self._cells),
            searching=tuple(action == _SEARCH for action in self._chosen),
            persons=tuple(positions[cell] for cell in cells),
            found_by=tuple(
                finds[person][0] if person in finds else None for person in world.everybody
            ),
            step=world.step,
            timestep_limit=self.timestep_limit,
            vector=self.vector,
            ending=self._ending,
        )

    # Phase 2 of a step.

    def _judge(
        self, targets: list[int], crashed: bool, rewards: dict[str, float]
    ) -> tuple[list[int], Ending | None]:
        """Fill in the rewards and note who was found.

        Args:
            targets: where each drone tried to go.
            crashed: whether a drone left the grid or collided.
            rewards: holds the table's last line for every drone; the others are filled in.

        Returns:
            The drones' cells after moving, and why the episode ends, if it does.
        """
        searches = _searches(self._chosen, self._cells)
        finders = self._world.search(searches) if searches else set()
        ending = None
        if crashed or finders or self._world.step == self._last_step:
            ending = self._judge_turning_point(targets, finders, rewards)
        else:
            self._pay_unsuccessful_searches(searches, rewards)
        if OFF_GRID in targets:  # who tried to leave has stayed
            targets = [
                cell if target == OFF_GRID else target
                for cell, target in zip(self._cells, targets, strict=True)
            ]
        return targets, ending

    def _judge_turning_point(
        self, targets: list[int], finders: set[int], rewards: dict[str, float]
    ) -> Ending | None:
        """Judge a step in which somebody was found, drones crashed or the time is up.

        Returns:
            Why the episode ends, if it does.
        """
        scenario, world, chosen = self._scenario, self._world, self._chosen
        scheme, limit = scenario.reward_scheme, scenario.timestep_limit
        beyond, shown, t = self._beyond_step, world.probability, world.step
        time_limit_reached = t == self._last_step
        shared = rules.same_cell(targets)
        crashes = {*shared, OFF_GRID}
        for drone, target in enumerate(targets):
            searched = chosen[drone] == _SEARCH
            if searched or time_limit_reached or target in crashes:
                points = rules.reward(
                    scheme,
                    target in shared,
                    target == OFF_GRID,
                    drone in finders,
                    time_limit_reached,
                    drone in self._finders,
                    searched,
                    shown(self._cells[drone]) if searched else 0.0,
                    t,
                    limit,
                    scheme.step * t + beyond[drone],
                )
                rewards[self._names[drone]] = points
                beyond[drone] += points - scheme.step
        if finders:
            self._found = True
            self._finders |= finders
        return rules.ending(
            not world.missing, bool(shared), OFF_GRID in targets, time_limit_reached
        )

    def _pay_unsuccessful_searches(
        self, searches: dict[int, int], rewards: dict[str, float]
    ) -> None:
        """Judge a step in which nothing happened but searches that found nobody."""
        scheme, shown = self._scenario.reward_scheme, self._world.probability
        for cell, drone in searches.items():
            points = rules.unsuccessful_search_reward(scheme, shown(cell))
            rewards[self._names[drone]] = points
            self._beyond_step[drone] += points - scheme.step

    # The window and the painter, made when first needed.

    def _get_painter(self) -> Painter:
        if self._painter is None:
            from DroneSwarmSearch.rendering.painter import Painter

            self._painter = Painter(
                self.grid_size,
                render_grid=self.render_grid,
                render_gradient=self.render_gradient,
                palette=self.palette,
            )
        return self._painter

    def _get_window(self) -> Window:
        if self._window is None:
            from DroneSwarmSearch.rendering.window import Window

            self._window = Window(
                self._get_painter(), title="Drone swarm search", fps=self.metadata["render_fps"]
            )
        return self._window

    def _show(self) -> None:
        """Show the state that a reset or a step has led to; the episode goes on if that fails."""
        try:
            self._get_window().show(self.frame())
        except RuntimeError as problem:
            self._get_window().dismiss()
            warnings.warn(
                f"{problem}; the episode goes on without being shown, and the next reset "
                "tries to open the window again",
                stacklevel=3,
            )

    def __getstate__(self) -> dict[str, Any]:
        """Copies and pickles go on identically, but have no window."""
        return {**self.__dict__, "_window": None, "_painter": None}

    def _check_name(self, agent: object) -> None:
        if agent not in self._names:
            raise ValueError(f"agent must be one of {names_in_words(self._names)}, got {agent!r}")


def _searches(chosen: bytes, cells: list[int]) -> dict[int, int]:
    """The cells that are searched, each with its drone: before a step no two share one."""
    searches = {}
    drone = chosen.find(_SEARCH)
    while drone >= 0:
        searches[cells[drone]] = drone
        drone = chosen.find(_SEARCH, drone + 1)
    return searches
