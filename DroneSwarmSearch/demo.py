"""The demo: watch a search in a window or a terminal, fly a drone, or record a video."""

from __future__ import annotations

import argparse
import os
import sys
import textwrap
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import replace

from DroneSwarmSearch._internal.console import printed_warnings
from DroneSwarmSearch.demo_options import parse, search_of
from DroneSwarmSearch.env import DroneSwarmSearch
from DroneSwarmSearch.evaluation.suite import NamedSearch
from DroneSwarmSearch.evaluation.tables import print_table
from DroneSwarmSearch.frame import Frame
from DroneSwarmSearch.observations import Observation
from DroneSwarmSearch.policies import make
from DroneSwarmSearch.rendering import terminal
from DroneSwarmSearch.rendering.palette import Look
from DroneSwarmSearch.rendering.player import (
    SCORE_HEADERS,
    Flight,
    Player,
    Recording,
    Score,
    score_row,
)
from DroneSwarmSearch.rendering.video import write_video
from DroneSwarmSearch.rules import OFF_GRID, Action, neighbours

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
        The exit code: 0, 1 if the output cannot be written, or 130 after Ctrl-C.

    Raises:
        SystemExit: after `--help` (code 0), or if an option is invalid (code 2).
    """
    parser, options = parse(argv)
    try:
        _run(parser, options)
        return 0
    except KeyboardInterrupt:
        print("\ninterrupted", file=sys.stderr)
        return INTERRUPTED
    except OSError as error:
        # Python must not fail again when it flushes the rest of the output.
        os.dup2(os.open(os.devnull, os.O_WRONLY), sys.stdout.fileno())
        if not isinstance(error, BrokenPipeError):  # which says that the reader has gone
            print(f"cannot write the output: {error.strerror}", file=sys.stderr)
        return 1


def _run(parser: argparse.ArgumentParser, options: argparse.Namespace) -> None:
    """Play with these options, and print summaries."""
    try:
        with printed_warnings():
            search = search_of(options)
        episode = _Episode(search, options, options.seed)
    except FileNotFoundError:
        parser.error(f"argument --policy: there is no file {options.policy!r}")
    except (TypeError, ValueError) as error:
        parser.error(str(error))
    if options.search is not None:
        print(textwrap.fill(f"{search.name}: {search.reason}", TEXT_WIDTH) + "\n", flush=True)
    if options.record is not None:
        _record(parser, options, episode)
    elif options.text or not _play_in_window(parser, options, search):
        terminal.show(episode.frames(), options.fps)
    else:
        return
    print("\n".join(_summary(search, options.seed, options.policy, episode.frame)), flush=True)


class _Episode:
    """A search from its reset to its end.

    Args:
        search: the search.
        options: of the command line; they name the policy.
        seed: the seed of the episode.
        policy: the policy's name or file, in place of the option's.

    Attributes:
        label: who flies the drones.
        frame: the current one.

    Raises:
        OSError, TypeError, ValueError: an argument is invalid.
    """

    def __init__(
        self, search: NamedSearch, options: argparse.Namespace, seed: int, policy: str = ""
    ) -> None:
        name = policy or options.policy
        self.label = f"you and {name}" if options.manual and not policy else name
        self._policy = make(name, search.scenario)
        self._policy.reset(seed=seed)
        self._hide_person = options.hide_person
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
        hides = self._hide_person and frame.ending is None
        return replace(frame, policy=self.label, hide_persons=hides)


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
    search: NamedSearch, seed: int, policy: str, frame: Frame, stopped: str = ""
) -> list[str]:
    """The result of an episode as lines of text.

    Args:
        search: the search.
        seed: of the episode.
        policy: who flies the drones.
        frame: the last one that was shown.
        stopped: why the user ended it early.
    """
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
    if frame.probability_of_success is not None:
        success = f"{frame.probability_of_success:.1%} (probability of success)"
        lines.append(f"POS             {success}")
    if search.scale is not None:
        cell, step = search.scale.metres_per_cell, search.scale.seconds_per_step
        lines.append(f"scale           cells of {cell:g} m, steps of {step:.3g} s")
    return lines


def _look(options: argparse.Namespace) -> Look:
    return Look(grid=not options.no_grid, gradient=not options.no_gradient)


def _record(
    parser: argparse.ArgumentParser, options: argparse.Namespace, episode: _Episode
) -> None:
    from DroneSwarmSearch.rendering.painter import Painter

    path, first = options.record, episode.frame
    print(f"recording to {path}, at most {first.timestep_limit} steps ...", file=sys.stderr)
    painter = Painter(first.grid_size, _look(options))
    try:
        write_video(path, painter, episode.frames(), fps=options.fps, hold=HOLD_VIDEO)
    except (ImportError, ValueError) as error:
        parser.error(f"argument --record: {error}")
    except OSError as error:
        parser.exit(1, f"cannot write {path}: {error.strerror or error}\n")


# The window.


def _play_in_window(
    parser: argparse.ArgumentParser, options: argparse.Namespace, search: NamedSearch
) -> bool:
    """Play in a window until the user closes it.

    Returns:
        Whether a window could be opened.
    """
    from DroneSwarmSearch.rendering.player_window import PlayerWindow

    window = PlayerWindow(search.scenario.grid_size, _look(options), title=TITLE)
    try:
        window.open()
    except RuntimeError as error:
        reason = error.__cause__ or error
        if options.manual:
            parser.error(f"--manual needs a display, and no window can be opened ({reason})")
        print(f"no window can be opened ({reason}): showing text", file=sys.stderr)
        return False
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
        episode = _Episode(self._search, self._options, seed)
        title = f"{self._search.name}, {episode.label}, "
        if self._options.manual:
            rivals = self._rivals if self._options.hide_person else list
            self._recording = Flight(episode.frame, episode.step, title, rivals)
        else:
            self._recording = Recording(episode.frames(), title)
        self._seed = seed
        return self._recording

    def _rivals(self) -> list[Score]:
        """The results of the policies in the search that was flown."""
        episodes = [_Episode(self._search, self._options, self._seed, name) for name in RIVALS]
        return [Score(each.label, list(each.frames())[-1]) for each in episodes]

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
        seen = recording.frames[recording.seen]
        print("\n".join(_summary(self._search, self._seed, policy, seen, stopped)), flush=True)
        if not (options.manual and recording.end_was_seen):
            return
        if options.hide_person:
            print()
            print_table(SCORE_HEADERS, [score_row(score) for score in recording.scores])
        else:
            print("with --hide-person, your result is compared with those of the policies")
