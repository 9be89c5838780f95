"""The demo: watch a search in a window or a terminal, fly a drone, or record a video."""

from __future__ import annotations

import argparse
import os
import re
import sys
import time
from collections.abc import Callable, Iterator, Mapping, Sequence
from itertools import chain
from pathlib import Path
from typing import TYPE_CHECKING

from DroneSwarmSearch._internal import checks
from DroneSwarmSearch.env import DroneSwarmSearch
from DroneSwarmSearch.observations import Observation
from DroneSwarmSearch.policies import POLICIES, make
from DroneSwarmSearch.rendering import terminal
from DroneSwarmSearch.rendering.film import SUFFIXES, write_film
from DroneSwarmSearch.rendering.frame import Frame
from DroneSwarmSearch.rendering.palette import PALETTES
from DroneSwarmSearch.rules import OFF_GRID, Action, neighbours
from DroneSwarmSearch.scenario import Cell, Scenario

if TYPE_CHECKING:
    from DroneSwarmSearch.rendering.painter import Painter

__all__ = ["main"]

DESCRIPTION = """\
Drones search a grid at sea for shipwrecked persons who drift. The drones start around the
border, the persons in the middle. Every drone flies to the cell with the highest probability,
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
    add("--grid-size", metavar="N", type=int, default=20, help="cells along a side")
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
    add("--seed", metavar="N", type=int, default=12, help="seed of the persons' drift")
    return parser


class _HelpFormatter(argparse.ArgumentDefaultsHelpFormatter):
    """Shows the defaults of options with a value; those of flags are obvious."""

    def _get_help_string(self, action: argparse.Action) -> str | None:
        if action.nargs == 0 or action.default is None:
            return action.help
        return super()._get_help_string(action)


def _on_option(message: str) -> str:
    """An error message on a parameter, with the name of the option that sets it."""

    def option(match: re.Match[str]) -> str:
        others = {"n_drones": "drones", "name": "policy", "path": "record"}
        name = others.get(match[1], match[1].replace("_", "-"))
        return f"argument --{name}: must "

    return re.sub(r"^(\w+)(?:\[\d+\])? must ", option, message)


# The episode.


class _Episode:
    """A search from reset to end, with its summary.

    Args:
        scenario: the search.
        policy: a policy's name or a file of weights.
        seed: the seed of the episode.

    Raises:
        OSError, TypeError, ValueError: an argument is invalid.
    """

    def __init__(self, scenario: Scenario, policy: str, seed: int) -> None:
        self.env = DroneSwarmSearch(scenario=scenario, render_mode=None)
        steering = make(policy, scenario)
        self._observations, _ = self.env.reset(
            seed, drones_positions=_around_the_border(scenario.n_drones, scenario.grid_size)
        )
        steering.reset(seed=seed)
        self.policy: Steering = steering
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
            yield env.frame()

    def summary(self, stopped: str) -> str:
        """The result as a few lines of text; `stopped` says why the user ended it early."""
        frame = self.env.frame()
        outcome = f"stopped: {stopped}"
        if frame.ending is not None:
            outcome = f"{frame.outcome} ({frame.ending.description})"
        lines = [
            f"outcome        {outcome}",
            f"return         {self._total:,.1f} (sum over the drones)",
            f"steps          {frame.step} of at most {frame.timestep_limit}",
            f"persons found  {sum(frame.found)} of {len(frame.persons)}",
        ]
        if self._seconds > 0:
            speed = frame.step / self._seconds
            lines.append(f"speed          {speed:,.0f} steps/s (the environment alone)")
        return "\n".join(lines)


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
        centre = options.grid_size // 2
        scenario = Scenario(
            grid_size=options.grid_size,
            n_drones=options.drones,
            vector=options.vector,
            person_initial_position=((centre, centre),) * options.persons,
            disperse_constant=options.disperse_constant,
            timestep_limit=options.timestep_limit,
            probability_of_detection=options.probability_of_detection,
            bayesian_update=not options.prior,
        )
        episode = _Episode(scenario, options.policy, options.seed)
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


def _painter(options: argparse.Namespace) -> Painter:
    from DroneSwarmSearch.rendering.painter import Painter

    return Painter(
        options.grid_size,
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
        pictures = map(_painter(options).pixels, episode.frames())
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
    window = Window(_painter(options), title=title, fps=options.fps)
    if options.manual:
        episode.policy = _piloted(
            episode.policy, options.grid_size, lambda: keyboard.wait_for_action(window)
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
        terminal.show(chain([first], frames), options.fps)
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
