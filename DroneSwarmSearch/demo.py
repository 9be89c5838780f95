"""The demo: watch a search in a window or a terminal, fly a drone, or record a video.

The search is a toy in cells and steps, or an incident at sea in metres and seconds.
"""

from __future__ import annotations

import argparse
import itertools
import os
import re
import sys
import time
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from DroneSwarmSearch import leeway
from DroneSwarmSearch._internal import checks
from DroneSwarmSearch._internal.console import printed_warnings
from DroneSwarmSearch.drift.persons import Person, warn_of_mass_beyond
from DroneSwarmSearch.drift.scale import Scale
from DroneSwarmSearch.env import DroneSwarmSearch
from DroneSwarmSearch.observations import Observation
from DroneSwarmSearch.policies import POLICIES, make
from DroneSwarmSearch.rendering import terminal
from DroneSwarmSearch.rendering.film import SUFFIXES, write_film
from DroneSwarmSearch.rendering.frame import Frame
from DroneSwarmSearch.rendering.palette import PALETTES
from DroneSwarmSearch.rules import OFF_GRID, Action, neighbours
from DroneSwarmSearch.scenario import MISSIONS, Cell, Scenario

if TYPE_CHECKING:
    from DroneSwarmSearch.rendering.painter import Painter

__all__ = ["main"]

DESCRIPTION = """\
Drones search a grid at sea for shipwrecked persons who drift. The drones start around the
border, the persons in the middle; in an incident, the middle of the grid is where the persons are
expected halfway through the search. Every drone flies to the cell with the highest probability,
discounted by its distance (the policy "greedy-matrix"), unless you choose another policy or
fly drone 0 yourself.
"""

EPILOG = """\
keys in the window: Esc or Q quits. With --manual, arrow keys move drone 0, space searches
its cell, i or . idles; every key is one step for all drones. Stay inside the grid and away
from the other drones: leaving the grid and collisions end the search.
"""

TITLE = "Drone swarm search"
MANUAL_TITLE = f"{TITLE}: arrows move drone 0, space searches, i idles, Esc quits"

HOLD_WINDOW, HOLD_FILM = 3.0, 2.0
"""Seconds for which the last frame stays."""

FPS_LEAST, FPS_MOST = 0.1, 50.0
"""A GIF cannot show more frames per second."""

USUAL_POLICY = "greedy-matrix"
"""It needs only observations, so it also works while you fly drone 0."""

INCIDENT = """\
Persons, rafts or boats that drift with wind and current, in metres and seconds. For example:
--object-class PIW-1 --wind 240 20 --current 60 0.5 --position-sd 500 --adrift 3600
"""

NEEDS_OBJECT = (
    *("wind", "current", "position_sd", "adrift", "diffusivity"),
    *("cell", "drone_speed"),
)
NOT_WITH_OBJECT = ("vector", "disperse_constant")
"""Options of an incident, and those whose place they take."""

GRID_USUAL, GRID_MOST = 20, 100
"""The grid of an incident has at least and at most so many cells along a side, by default."""

LEFT_OUT = 0.01
"""The share of the forecast that such a grid may leave out."""

INTERRUPTED = 130
"""The exit code of shells after Ctrl-C."""


Steering = Callable[[Mapping[str, Observation]], dict[str, int]]


def main(argv: Sequence[str] | None = None) -> int:
    """Run the demo.

    Args:
        argv: the arguments of the command line; those of the process if None.

    Returns:
        The exit code: 0, or 130 after Ctrl-C.

    Raises:
        SystemExit: after `--help` (code 0), or if an option is invalid (code 2).
    """
    parser = _parser()
    options = parser.parse_args(argv)
    if options.manual and (options.text or options.record):
        parser.error("argument --manual: needs the window, so not with --text or --record")
    if options.manual and options.policy != USUAL_POLICY:
        parser.error(
            f"argument --manual: the other drones use {USUAL_POLICY}, so --policy is not allowed"
        )
    for name in NEEDS_OBJECT if options.object_class is None else NOT_WITH_OBJECT:
        if getattr(options, name) != parser.get_default(name):
            allowed = "needs" if options.object_class is None else "not allowed with"
            parser.error(f"argument {_option(name)}: {allowed} --object-class")
    if options.object_class is not None and options.wind is None:
        parser.error("argument --object-class: needs --wind FROM KNOTS")
    try:
        return _run(parser, options)
    except KeyboardInterrupt:
        print("\ninterrupted", file=sys.stderr)
        return INTERRUPTED
    except BrokenPipeError:
        # The reader of the output has gone: flushing the buffer must not fail again.
        os.dup2(os.open(os.devnull, os.O_WRONLY), sys.stdout.fileno())
        return 1


# The command line.


def _parser() -> argparse.ArgumentParser:
    started_as = Path(sys.argv[0]).name if sys.argv else ""
    parser = argparse.ArgumentParser(
        prog="python -m DroneSwarmSearch" if started_as == "__main__.py" else None,
        description=DESCRIPTION,
        epilog=EPILOG,
        formatter_class=_HelpFormatter,
    )
    flag = argparse.BooleanOptionalAction
    view = parser.add_argument_group("view (a window if there is a display, otherwise text)")
    add = view.add_argument
    add("--manual", action="store_true", help="fly drone 0 with the arrow keys")
    add("--text", action="store_true", help="stay in the terminal")
    add("--record", metavar="FILE", type=Path, help="write a video instead, .gif or .mp4")
    add("--fps", type=float, default=6.0, help="steps shown per second")
    add("--grid", action=flag, default=True, help="draw lines between the cells")
    add("--gradient", action=flag, default=True, help="colour the cells smoothly")
    add("--palette", choices=tuple(PALETTES), default="classic", help="colours of the cells")
    add(
        "--prior",
        action="store_true",
        help="show the forecast of the drift instead of the posterior, to you and to the drones",
    )
    add = parser.add_argument_group("search").add_argument
    add(
        "--policy",
        metavar="NAME",
        default=USUAL_POLICY,
        help=f"the drones' policy: {', '.join(POLICIES)}, or a file of weights, .npz",
    )
    add("--drones", metavar="N", type=int, default=4, help="number of drones")
    add(
        "--grid-size",
        metavar="N",
        type=int,
        help=f"cells along a side (default: {GRID_USUAL}; in an incident, as many as hold 99%% of "
        f"the forecast, at most {GRID_MOST})",
    )
    add("--persons", metavar="N", type=int, default=1, help="number of persons")
    add(
        "--vector",
        metavar=("X", "Y"),
        nargs=2,
        type=float,
        default=(0.2, 0.1),
        help="drift in cells per step, y downward",
    )
    add(
        "--disperse-constant",
        metavar="C",
        type=float,
        default=3.0,
        help="how quickly the persons may stray from the drift, at least 0",
    )
    add("--timestep-limit", metavar="N", type=int, default=100, help="most steps")
    add(
        "--probability-of-detection",
        metavar="P",
        type=float,
        default=1.0,
        help="chance that a search of the right cell finds the person, 0 to 1",
    )
    add(
        "--mission",
        choices=MISSIONS,
        default="rescue",
        help="find the persons, or gain as much probability of success as possible",
    )
    add("--seed", metavar="N", type=int, default=12, help="seed of the persons' drift")
    _add_incident(parser.add_argument_group("incident", INCIDENT).add_argument)
    return parser


def _add_incident(add: Callable[..., object]) -> None:
    """Add the options of an incident."""
    add(
        "--object-class",
        metavar="CLASS",
        help="what drifts: a key of leeway.CLASSES, such as PIW-1, a person in the water",
    )
    add(
        "--wind",
        metavar=("FROM", "KNOTS"),
        nargs=2,
        type=float,
        help="where the wind comes from, in degrees, and its speed 10 m above the sea",
    )
    add(
        "--current",
        metavar=("TOWARDS", "KNOTS"),
        nargs=2,
        type=float,
        default=(0.0, 0.0),
        help="where the current flows to, in degrees, and its speed",
    )
    add(
        "--position-sd",
        metavar="METRES",
        type=float,
        default=0.0,
        help="standard deviation of the last known position, along each axis",
    )
    add(
        "--adrift",
        metavar="SECONDS",
        type=float,
        default=0.0,
        help="from the last known position to the begin of the search",
    )
    add(
        "--diffusivity",
        metavar="M2/S",
        type=float,
        default=5.0,
        help="of the turbulent sea, usually 1 to 10",
    )
    add(
        "--cell",
        metavar="METRES",
        type=float,
        default=130.0,
        help="side of a cell: the width of the strip that a drone sees",
    )
    add(
        "--drone-speed",
        metavar="M/S",
        type=float,
        default=10.0,
        help="speed of the drones: a step is the time in which they cross a cell",
    )


class _HelpFormatter(argparse.ArgumentDefaultsHelpFormatter):
    """Shows the defaults of options with a value; those of flags are obvious."""

    def _get_help_string(self, action: argparse.Action) -> str | None:
        if action.nargs == 0 or action.default is None:
            return action.help
        return super()._get_help_string(action)


def _on_option(message: str) -> str:
    """An error message on a parameter, with the name of the option that sets it."""
    others = {
        **{"n_drones": "drones", "name": "policy", "path": "record"},
        **{"swath": "cell", "speed": "drone_speed"},
    }

    def start(match: re.Match[str]) -> str:
        return f"argument {_option(others.get(match[1], match[1]))}: must "

    return re.sub(r"^(\w+)(?:\[\d+\])? must ", start, message)


def _option(name: str) -> str:
    return f"--{name.replace('_', '-')}"


# The search.


def _scenario(options: argparse.Namespace) -> Scenario:
    """The search that the options describe."""
    common = {
        "n_drones": options.drones,
        "timestep_limit": options.timestep_limit,
        "bayesian_update": not options.prior,
        "mission": options.mission,
    }
    if options.object_class is not None:
        return _incident(options, common)
    size = GRID_USUAL if options.grid_size is None else options.grid_size
    centre = size // 2
    return Scenario(
        grid_size=size,
        vector=options.vector,
        person_initial_position=((centre, centre),) * options.persons,
        disperse_constant=options.disperse_constant,
        probability_of_detection=options.probability_of_detection,
        **common,
    )


def _incident(options: argparse.Namespace, common: Mapping[str, Any]) -> Scenario:
    """The search for persons who drift with wind and current.

    Unless the options give its size, the grid is the smallest that holds the forecast.
    """
    person = leeway.person(
        options.object_class,
        start=(0, 0),
        position_sd=options.position_sd,
        wind=_flow("wind", leeway.wind_from, options.wind),
        current=_flow("current", leeway.current_towards, options.current),
        diffusivity=options.diffusivity,
        adrift=options.adrift,
        scale=_scale(options),
        probability_of_detection=options.probability_of_detection,
    )
    limit = options.timestep_limit
    size = options.grid_size
    if size is None:
        sizes = range(GRID_USUAL, GRID_MOST)
        size = next((n for n in sizes if _holds(_placed(person, n, limit), n, limit)), GRID_MOST)
    scenario = Scenario(size, persons=(_placed(person, size, limit),) * options.persons, **common)
    warn_of_mass_beyond(scenario.situation, size, limit, stacklevel=1)
    return scenario


def _scale(options: argparse.Namespace) -> Scale:
    return Scale.for_drone(options.drone_speed, options.cell)


def _flow(
    name: str, vector: Callable[[float, float], tuple[float, float]], given: Sequence[float]
) -> tuple[float, float]:
    """A wind or a current in m/s, (east, north), from degrees and knots."""
    try:
        east, north = vector(*given)
    except ValueError as error:
        raise ValueError(f"{name} must be degrees and knots: {error}") from None
    return east * leeway.KNOT, north * leeway.KNOT


def _placed(person: Person, grid_size: int, timestep_limit: int) -> Person:
    """The person where the mean position halfway through the search is the middle of the grid."""
    centre, last = grid_size // 2, grid_size - 1
    steps = person.drifts[0].adrift + timestep_limit / 2
    mean = np.average([drift.vector for drift in person.drifts], axis=0, weights=person.weights)
    x, y = np.rint(centre - steps * mean).tolist()
    if person.drifts[0].starts_in_known_cell:
        x, y = (min(max(cell, 0.0), last) for cell in (x, y))
    return replace(person, drifts=tuple(replace(drift, start=(x, y)) for drift in person.drifts))


def _holds(person: Person, grid_size: int, timestep_limit: int) -> bool:
    """Whether a grid holds the forecast at the start, halfway and at the end."""
    steps = (0, timestep_limit // 2, timestep_limit)
    return all(person.mass_beyond(grid_size, step) <= LEFT_OUT for step in steps)


# The episode.


class _Episode:
    """A search from reset to end, with its summary.

    Args:
        scenario: the search.
        policy: a policy's name or a file of weights.
        seed: the seed of the episode.
        scale: of an incident, for the summary.

    Raises:
        OSError, TypeError, ValueError: an argument is invalid.
    """

    def __init__(
        self, scenario: Scenario, policy: str, seed: int, scale: Scale | None = None
    ) -> None:
        self.env = DroneSwarmSearch(scenario=scenario, render_mode=None)
        steering = make(policy, scenario)
        self._observations, _ = self.env.reset(
            seed, drones_positions=_around_the_border(scenario.n_drones, scenario.grid_size)
        )
        steering.reset(seed=seed)
        self.policy: Steering = steering
        self._scale = scale
        self._searches: list[Cell] = []
        self._total = 0.0
        self._seconds = 0.0

    def frames(self) -> Iterator[Frame]:
        """Play the episode and yield its frames, that of the reset included."""
        env = self.env
        yield env.frame()
        while env.agents:
            actions = self.policy(self._observations)
            start = time.perf_counter()
            self._observations, rewards, _, _, _ = env.step(actions)
            self._seconds += time.perf_counter() - start
            self._total += rewards["total_reward"]
            frame = env.frame()
            self._searches += itertools.compress(frame.drones, frame.searching)
            yield frame

    def summary(self, stopped: str) -> str:
        """The result as a few lines of text; `stopped` says why the user ended it early."""
        frame = self.env.frame()
        outcome = f"stopped: {stopped}"
        if frame.ending is not None:
            outcome = f"{frame.outcome} ({frame.ending.description})"
        digits = 3 if abs(self._total) < 10 else 1
        lines = [
            f"outcome         {outcome}",
            f"return          {self._total:,.{digits}f} (sum over the drones)",
            f"steps           {frame.step} of at most {frame.timestep_limit}",
        ]
        if frame.persons:
            lines.append(f"persons found   {sum(frame.found)} of {len(frame.persons)}")
        else:
            cells, searches = len(set(self._searches)), len(self._searches)
            repeated = f"{searches - cells} of {searches} searches repeated"
            lines.append(f"cells searched  {cells} of {frame.grid_size**2:,}; {repeated}")
        if frame.probability_of_success is not None:
            success = f"{frame.probability_of_success:.1%} (probability of success)"
            lines.append(f"POS             {success}")
        if self._scale is not None:
            lines.append(f"scale           {_in_metres_and_seconds(frame, self._scale)}")
        if self._seconds > 0:
            speed = frame.step / self._seconds
            lines.append(f"speed           {speed:,.0f} steps/s (the environment alone)")
        return "\n".join(lines)


def _in_metres_and_seconds(frame: Frame, scale: Scale) -> str:
    """The size of the grid and the length of the search."""
    side = scale.metres(frame.grid_size) / 1000
    minutes = scale.seconds(frame.step) / 60
    return (
        f"{frame.grid_size} x {frame.grid_size} cells of {scale.metres_per_cell:g} m are "
        f"{side:.3g} km x {side:.3g} km; {frame.step} steps of {scale.seconds_per_step:.3g} s are "
        f"{minutes:.3g} min"
    )


def _around_the_border(n_drones: int, grid_size: int) -> list[Cell] | None:
    """Start cells spread evenly around the border, clockwise from (0, 0).

    None if there are more drones than cells on the border: the environment then places them.
    """
    last = grid_size - 1
    border = [
        *((i, 0) for i in range(last)),
        *((last, i) for i in range(last)),
        *((last - i, last) for i in range(last)),
        *((0, last - i) for i in range(last)),
    ]
    if n_drones > len(border):
        return None
    return [border[drone * len(border) // n_drones] for drone in range(n_drones)]


def _run(parser: argparse.ArgumentParser, options: argparse.Namespace) -> int:
    """Play one episode with these options, and print its summary."""
    try:
        checks.real("fps", options.fps, FPS_LEAST, FPS_MOST)
        checks.integer("persons", options.persons, 1)
        if options.record and options.record.suffix.lower() not in SUFFIXES:
            raise ValueError(f"path must end in .gif or .mp4, got {options.record.name!r}")
        with printed_warnings():
            scenario = _scenario(options)
        scale = None if options.object_class is None else _scale(options)
        episode = _Episode(scenario, options.policy, options.seed, scale)
    except FileNotFoundError:
        parser.error(f"argument --policy: there is no file {options.policy!r}")
    except (TypeError, ValueError) as error:
        parser.error(_on_option(str(error)))
    stopped = ""
    if options.record:
        _record(parser, episode, options)
    elif options.text:
        terminal.show(episode.frames(), options.fps)
    else:
        stopped = _show_in_window(parser, episode, options)
    print(episode.summary(stopped), flush=True)
    return 0


# The views.


def _painter(grid_size: int, options: argparse.Namespace) -> Painter:
    from DroneSwarmSearch.rendering.painter import Painter

    return Painter(
        grid_size,
        render_grid=options.grid,
        render_gradient=options.gradient,
        palette=options.palette,
    )


def _record(
    parser: argparse.ArgumentParser, episode: _Episode, options: argparse.Namespace
) -> None:
    path: Path = options.record
    limit = episode.env.timestep_limit
    print(f"recording to {path}, at most {limit} steps ...", file=sys.stderr)
    try:
        pictures = map(_painter(episode.env.grid_size, options).pixels, episode.frames())
        write_film(path, pictures, fps=options.fps, hold=HOLD_FILM)
    except ImportError as error:
        parser.error(str(error))
    except OSError as error:
        parser.error(f"cannot write {path}: {error.strerror or error}")


def _show_in_window(
    parser: argparse.ArgumentParser, episode: _Episode, options: argparse.Namespace
) -> str:
    """Play in a window, or as text if no window can be opened.

    Returns:
        Why the user ended the episode early; empty if it was played to its end.
    """
    from DroneSwarmSearch.rendering import keyboard
    from DroneSwarmSearch.rendering.window import Window

    title = MANUAL_TITLE if options.manual else TITLE
    grid_size = episode.env.grid_size
    window = Window(_painter(grid_size, options), title=title, fps=options.fps)
    if options.manual:
        episode.policy = _piloted(
            episode.policy, grid_size, lambda: keyboard.wait_for_action(window)
        )
    frames = episode.frames()
    first = next(frames)
    try:
        window.show(first)
    except RuntimeError as error:
        reason = error.__cause__ or error
        if options.manual:
            parser.error(f"--manual needs a display, and no window can be opened ({reason})")
        print(f"no window can be opened ({reason}): showing text", file=sys.stderr)
        terminal.show(itertools.chain([first], frames), options.fps)
        return ""
    if options.manual:
        print(EPILOG, flush=True)
    try:
        for frame in frames:
            if not options.manual:  # with --manual, the pilot reads the events
                keyboard.handle_events(window)
            window.show(frame)
        keyboard.hold(window, HOLD_WINDOW)
    except keyboard.QuitError as reason:
        return str(reason)
    finally:
        window.close()
    return ""


def _piloted(policy: Steering, grid_size: int, choose: Callable[[], Action]) -> Steering:
    """Drone 0 takes the actions that `choose` returns; a policy steers the others."""

    def steer(observations: Mapping[str, Observation], /) -> dict[str, int]:
        action = choose()
        (x, y), matrix = observations["drone0"]["observation"]
        ahead = neighbours(y * grid_size + x, grid_size)[action]
        if ahead != OFF_GRID:
            y, x = divmod(ahead, grid_size)
        # The policy keeps the others away from the cell in which it sees drone 0.
        seen: dict[str, Observation] = {**observations, "drone0": {"observation": ((x, y), matrix)}}
        return {**policy(seen), "drone0": int(action)}

    return steer
