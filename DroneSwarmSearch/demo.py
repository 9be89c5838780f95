"""The demo: watch a search in a window or a terminal, fly a drone, or record a video.

The search is a toy in cells and steps, or an incident at sea in metres and seconds.
"""

from __future__ import annotations

import argparse
import itertools
import os
import sys
import time
from collections.abc import Callable, Iterator, Mapping, Sequence
from pathlib import Path
from typing import TYPE_CHECKING

from DroneSwarmSearch._internal import checks
from DroneSwarmSearch._internal.console import printed_warnings
from DroneSwarmSearch.demo_options import EPILOG, message_on_option, parse, scale_of, scenario_of
from DroneSwarmSearch.drift.scale import Scale
from DroneSwarmSearch.env import DroneSwarmSearch
from DroneSwarmSearch.observations import Observation
from DroneSwarmSearch.policies import make
from DroneSwarmSearch.rendering import terminal
from DroneSwarmSearch.rendering.film import SUFFIXES, write_film
from DroneSwarmSearch.rendering.frame import Frame
from DroneSwarmSearch.rules import OFF_GRID, Action, neighbours
from DroneSwarmSearch.scenario import Cell, Scenario

if TYPE_CHECKING:
    from DroneSwarmSearch.rendering.painter import Painter

__all__ = ["main"]

TITLE = "Drone swarm search"
MANUAL_TITLE = f"{TITLE}: arrows move drone 0, space searches, i idles, Esc quits"

HOLD_WINDOW, HOLD_FILM = 3.0, 2.0
"""Seconds for which the last frame stays."""

FPS_LEAST, FPS_MOST = 0.1, 50.0
"""A GIF cannot show more frames per second."""

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
    parser, options = parse(argv)
    try:
        return _run(parser, options)
    except KeyboardInterrupt:
        print("\ninterrupted", file=sys.stderr)
        return INTERRUPTED
    except BrokenPipeError:
        # The reader of the output has gone: flushing the buffer must not fail again.
        os.dup2(os.open(os.devnull, os.O_WRONLY), sys.stdout.fileno())
        return 1


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
            scenario = scenario_of(options)
        scale = None if options.object_class is None else scale_of(options)
        episode = _Episode(scenario, options.policy, options.seed, scale)
    except FileNotFoundError:
        parser.error(f"argument --policy: there is no file {options.policy!r}")
    except (TypeError, ValueError) as error:
        parser.error(message_on_option(str(error)))
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
