"""The demo: watch a search in a window or a terminal, fly a drone, or record a video."""

from __future__ import annotations

import argparse
import itertools
import os
import sys
import textwrap
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING

from DroneSwarmSearch._internal import checks
from DroneSwarmSearch._internal.console import printed_warnings
from DroneSwarmSearch.demo_options import message_on_option, parse, search_of
from DroneSwarmSearch.drift.scale import Scale
from DroneSwarmSearch.env import DroneSwarmSearch
from DroneSwarmSearch.evaluation.suite import NamedSearch
from DroneSwarmSearch.evaluation.tables import print_table
from DroneSwarmSearch.frame import Frame
from DroneSwarmSearch.observations import Observation
from DroneSwarmSearch.policies import make
from DroneSwarmSearch.rendering import terminal
from DroneSwarmSearch.rendering.player import (
    SCORE_HEADERS,
    Flight,
    Player,
    Recording,
    Score,
    score_row,
)
from DroneSwarmSearch.rendering.video import FPS_LEAST, FPS_MOST, write_video
from DroneSwarmSearch.rules import OFF_GRID, Action, neighbours
from DroneSwarmSearch.scenario import Cell

if TYPE_CHECKING:
    from DroneSwarmSearch.rendering.painter import Painter

__all__ = ["main"]

TITLE = "Drone swarm search"

TEXT_WIDTH = 100
"""Characters in a line of sentences."""

HOLD_VIDEO = 2.0
"""Seconds for which the last picture of a video stays."""

INTERRUPTED = 130
"""The exit code of shells after Ctrl-C."""

RIVALS = ("greedy-matrix", "greedy-posterior", "greedy-forecast", "parallel-sweep")
"""The policies whose results are compared with a flight by hand; all are quick."""


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
    except OSError as error:
        # Python must not fail again when it flushes the rest of the output.
        os.dup2(os.open(os.devnull, os.O_WRONLY), sys.stdout.fileno())
        if not isinstance(error, BrokenPipeError):  # which says that the reader has gone
            print(f"cannot write the output: {error.strerror}", file=sys.stderr)
        return 1


# The episode.


class _Episode:
    """A search from its reset to its end.

    Args:
        search: the search.
        policy: a policy's name or a file of weights.
        seed: the seed of the episode.
        label: who flies the drones, for pictures; the policy's name if empty.
        hide_persons: whether missing persons are hidden in pictures until the end.

    Attributes:
        frame: the current one.

    Raises:
        OSError, TypeError, ValueError: an argument is invalid.
    """

    def __init__(
        self,
        search: NamedSearch,
        policy: str,
        seed: int,
        *,
        label: str = "",
        hide_persons: bool = False,
    ) -> None:
        self._policy = make(policy, search.scenario)
        self._policy.reset(seed=seed)
        self._label = label or policy
        self._hide_persons = hide_persons
        self._env = DroneSwarmSearch(scenario=search.scenario, render_mode=None)
        self._observations, _ = self._env.reset(seed, drones_positions=search.drones or None)
        self.frame = self._current_frame()

    def step(self, action: Action | None = None) -> Frame:
        """Let the policy choose the drones' actions, and play a step.

        Args:
            action: of drone 0, in place of the policy's.

        Returns:
            The new frame.
        """
        if action is None:
            actions = self._policy(self._observations)
        else:
            others = self._policy(_after_move_of_drone0(self._observations, action))
            actions = {**others, "drone0": int(action)}
        self._observations, _, _, _, _ = self._env.step(actions)
        self.frame = self._current_frame()
        return self.frame

    def frames(self) -> Iterator[Frame]:
        """The current frame, and those of all steps to the end."""
        yield self.frame
        while self.frame.ending is None:
            yield self.step()

    def _current_frame(self) -> Frame:
        frame = self._env.frame()
        hides = self._hide_persons and frame.ending is None
        return replace(frame, policy=self._label, hide_persons=hides)


def _after_move_of_drone0(
    observations: Mapping[str, Observation], action: Action
) -> dict[str, Observation]:
    """The observations with drone 0 where its action leads: a policy then keeps others away."""
    (x, y), matrix = observations["drone0"]["observation"]
    size = len(matrix)
    ahead = neighbours(y * size + x, size)[action]
    if ahead != OFF_GRID:
        y, x = divmod(ahead, size)
    return {**observations, "drone0": {"observation": ((x, y), matrix)}}


def _summary(
    search: NamedSearch, seed: int, policy: str, frames: Sequence[Frame], stopped: str = ""
) -> list[str]:
    """The result of an episode as lines of text.

    Args:
        search: the search.
        seed: of the episode.
        policy: who flies the drones.
        frames: those that were shown, from that of the reset.
        stopped: why the user ended it early.
    """
    frame = frames[-1]
    outcome = f"stopped: {stopped}"
    if frame.ending is not None:
        outcome = f"{frame.outcome} ({frame.ending.description})"
    total = frame.total_return or 0.0
    digits = 3 if abs(total) < 10 else 1
    lines = [
        f"search          {search.name}, seed {seed}",
        f"policy          {policy}",
        f"outcome         {outcome}",
        f"return          {total:,.{digits}f} (sum over the drones)",
        f"steps           {frame.step} of at most {frame.timestep_limit:,}",
    ]
    if frame.persons:
        lines.append(f"persons found   {sum(frame.found)} of {len(frame.persons)}")
    else:
        searched = [cell for each in frames for cell in _searched(each)]
        cells, searches = len(set(searched)), len(searched)
        repeated = f"{searches - cells} of {searches} searches repeated"
        lines.append(f"cells searched  {cells} of {frame.grid_size**2:,}; {repeated}")
    if frame.probability_of_success is not None:
        success = f"{frame.probability_of_success:.1%} (probability of success)"
        lines.append(f"POS             {success}")
    if search.scale is not None:
        lines.append(f"scale           {_in_metres_and_seconds(frame, search.scale)}")
    return lines


def _searched(frame: Frame) -> Iterator[Cell]:
    return itertools.compress(frame.drones, frame.searching)


def _in_metres_and_seconds(frame: Frame, scale: Scale) -> str:
    """The size of the grid and the length of the search."""
    side = scale.metres(frame.grid_size) / 1000
    minutes = scale.seconds(frame.step) / 60
    return (
        f"{frame.grid_size} x {frame.grid_size} cells of {scale.metres_per_cell:g} m are "
        f"{side:.3g} km x {side:.3g} km; {frame.step} steps of {scale.seconds_per_step:.3g} s are "
        f"{minutes:.3g} min"
    )


# The command.


def _run(parser: argparse.ArgumentParser, options: argparse.Namespace) -> int:
    """Play with these options, and print summaries."""
    try:
        checks.real("fps", options.fps, FPS_LEAST, FPS_MOST)
        with printed_warnings():
            search = search_of(options)
        episode = _Episode(search, options.policy, options.seed, hide_persons=options.hide_person)
    except FileNotFoundError:
        parser.error(f"argument --policy: there is no file {options.policy!r}")
    except (TypeError, ValueError) as error:
        parser.error(message_on_option(str(error)))
    if options.search is not None:
        print(textwrap.fill(f"{search.name}: {search.reason}", TEXT_WIDTH) + "\n", flush=True)
    if not (options.record or options.text) and _play_in_window(parser, search, options):
        return 0
    frames = []

    def seen() -> Iterator[Frame]:
        for frame in episode.frames():
            frames.append(frame)
            yield frame

    if options.record:
        _record(parser, seen(), options, search)
    else:
        terminal.show(seen(), options.fps)
    lines = _summary(search, options.seed, options.policy, frames)
    print("\n".join(lines), flush=True)
    return 0


def _painter(grid_size: int, options: argparse.Namespace, view: str = "matrix") -> Painter:
    from DroneSwarmSearch.rendering.painter import Painter

    return Painter(
        grid_size,
        render_grid=options.grid,
        render_gradient=options.gradient,
        palette=options.palette,
        view=view,
    )


def _record(
    parser: argparse.ArgumentParser,
    frames: Iterator[Frame],
    options: argparse.Namespace,
    search: NamedSearch,
) -> None:
    path: Path = options.record
    limit = search.scenario.timestep_limit
    print(f"recording to {path}, at most {limit} steps ...", file=sys.stderr)
    painter = _painter(search.scenario.grid_size, options)
    try:
        write_video(path, painter, frames, fps=options.fps, hold=HOLD_VIDEO)
    except ImportError as error:
        parser.error(str(error))
    except OSError as error:
        parser.exit(1, f"cannot write {path}: {error.strerror or error}\n")


# The window.


def _play_in_window(
    parser: argparse.ArgumentParser, search: NamedSearch, options: argparse.Namespace
) -> bool:
    """Play in a window until the user closes it.

    Returns:
        Whether a window could be opened.
    """
    from DroneSwarmSearch.rendering.player_window import PlayerWindow

    def painter(view: str) -> Painter:
        return _painter(search.scenario.grid_size, options, view)

    window = PlayerWindow(painter, title=TITLE)
    try:
        window.open()
    except RuntimeError as error:
        reason = error.__cause__ or error
        if options.manual:
            parser.error(f"--manual needs a display, and no window can be opened ({reason})")
        print(f"no window can be opened ({reason}): showing text", file=sys.stderr)
        return False
    if options.manual and window.is_hidden:
        window.close()
        parser.error("--manual needs a display, and SDL_VIDEODRIVER names one that shows nothing")
    with window:
        performances = _Performances(search, options)
        player = Player(performances.begin, seed=options.seed, fps=options.fps)
        performances.report(window.play(player))
    return True


class _Performances:
    """The episodes that are played in the window, one after another, and their reports.

    Args:
        search: the search.
        options: of the command line.
    """

    def __init__(self, search: NamedSearch, options: argparse.Namespace) -> None:
        self._search = search
        self._options = options
        self._recording: Recording | None = None
        self._seed = 0

    def begin(self, seed: int) -> Recording:
        """Report on the last episode if it has ended, and begin that of a seed."""
        if self._recording is not None and self._recording.end_was_seen:
            self.report("")
            print()
        options = self._options
        label = f"you and {options.policy}" if options.manual else options.policy
        episode = _Episode(
            self._search, options.policy, seed, label=label, hide_persons=options.hide_person
        )
        title = f"{self._search.name}, {label}, "
        if options.manual:
            rivals = self._rivals if options.hide_person else list
            self._recording = Flight(episode.frame, episode.step, title, rivals)
        else:
            self._recording = Recording(episode.frames(), title)
        self._seed = seed
        return self._recording

    def _rivals(self) -> list[Score]:
        """The results of the policies in the search that was flown."""
        return [
            Score(name, list(_Episode(self._search, name, self._seed).frames())[-1])
            for name in RIVALS
        ]

    def report(self, stopped: str) -> None:
        """Print what was seen of the last episode.

        Args:
            stopped: why the user ended it, if that was before its end.
        """
        recording, options = self._recording, self._options
        if recording is None:
            return
        policy = options.policy
        if options.manual:
            policy = f"you fly drone 0, {policy} the others"
        seen = recording.frames[: recording.seen + 1]
        lines = _summary(self._search, self._seed, policy, seen, stopped)
        print("\n".join(lines), flush=True)
        if not (options.manual and recording.end_was_seen):
            return
        if options.hide_person:
            print()
            print_table(SCORE_HEADERS, [score_row(score) for score in recording.scores])
        else:
            print("with --hide-person, your result is compared with those of the policies")
