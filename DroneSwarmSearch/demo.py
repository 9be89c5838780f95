"""The demo: watch a search in a window or a terminal, fly a drone, or record a video."""

from __future__ import annotations

import argparse
import os
import sys
import textwrap
from collections.abc import Iterator, Sequence
from dataclasses import replace

from DroneSwarmSearch._internal.errors import printed_warnings
from DroneSwarmSearch.demo_options import parse, search_of
from DroneSwarmSearch.env import DroneSwarmSearch
from DroneSwarmSearch.evaluation.suite import NamedSearch
from DroneSwarmSearch.frame import Frame
from DroneSwarmSearch.observations import Observation
from DroneSwarmSearch.policies import make
from DroneSwarmSearch.rendering.palette import Look
from DroneSwarmSearch.rendering.player import Player, Recording, Score
from DroneSwarmSearch.rendering.text import print_frames
from DroneSwarmSearch.rendering.video import write_video
from DroneSwarmSearch.rules import OFF_GRID, Action, neighbours

# Flights by hand are compared with these policies, all of which are quick.
RIVALS = ("greedy-matrix", "greedy-posterior", "greedy-forecast", "parallel-sweep")


def main(argv: Sequence[str] | None = None) -> int:
    """Run the demo; returns 0, 1 if the output cannot be written, or 130 after Ctrl-C."""
    parser, options = parse(argv)
    try:
        _run(parser, options)
        return 0
    except KeyboardInterrupt:
        print("\ninterrupted", file=sys.stderr)
        return 130  # as shells do after Ctrl-C
    except OSError as error:
        # Python must not fail again when it flushes the rest of the output.
        os.dup2(os.open(os.devnull, os.O_WRONLY), sys.stdout.fileno())
        if not isinstance(error, BrokenPipeError):  # which says that the reader has gone
            print(f"cannot write the output: {error.strerror}", file=sys.stderr)
        return 1


def _run(parser: argparse.ArgumentParser, options: argparse.Namespace) -> None:
    try:
        with printed_warnings():
            search = search_of(options)
        episode = _Episode(search, options, options.seed)
    except FileNotFoundError:
        parser.error(f"argument --policy: there is no file {options.policy!r}")
    except (TypeError, ValueError) as error:
        parser.error(str(error))
    if options.search is not None:
        print(textwrap.fill(f"{search.name}: {search.reason}", 100) + "\n", flush=True)
    if options.record is not None:
        _record(parser, options, episode)
    elif options.text or not _play_in_window(parser, options, search):
        print_frames(episode.frames(), options.fps)
    else:
        return
    _print_summary(search, options, options.seed, episode.frame)


class _Episode:
    """A search from its reset to its end, flown by a rival, or else as the options say.

    Attributes:
        frame: the current one; its policy names who flies the drones.
        search: what is played.
    """

    def __init__(
        self, search: NamedSearch, options: argparse.Namespace, seed: int, rival: str = ""
    ) -> None:
        name = rival or options.policy
        self._label = f"you and {name}" if options.manual and not rival else name
        self._policy = make(name, search.scenario)
        self._policy.reset(seed=seed)
        self._hide_person = options.hide_person
        self.search = search
        self._env = DroneSwarmSearch(scenario=search.scenario, render_mode=None)
        self._observations, _ = self._env.reset(seed, drones_positions=search.drones or None)
        self.frame = self._current_frame()

    def step(self, action: Action | None = None) -> Frame:
        """Play a step with the policy's actions, or another one for drone 0; return its frame."""
        if action is None:
            actions = self._policy(self._observations)
        else:
            # Shown drone 0 where its action leads, the policy keeps the others away.
            (x, y), matrix = self._observations["drone0"]["observation"]
            size = len(matrix)
            ahead = neighbours(y * size + x, size)[action]
            if ahead != OFF_GRID:
                y, x = divmod(ahead, size)
            moved: Observation = {"observation": ((x, y), matrix)}
            actions = self._policy({**self._observations, "drone0": moved})
            actions = {**actions, "drone0": int(action)}
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
        return replace(frame, policy=self._label, hide_persons=hides, scale=self.search.scale)


def _print_summary(
    search: NamedSearch, options: argparse.Namespace, seed: int, frame: Frame, stopped: str = ""
) -> None:
    """Print the result of an episode by its last frame, and why the user stopped it there."""
    policy, outcome = options.policy, f"stopped: {stopped}"
    if options.manual:
        policy = f"you fly drone 0, {policy} the others"
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
    print("\n".join(lines), flush=True)


def _look(options: argparse.Namespace) -> Look:
    return Look(grid=not options.no_grid, gradient=not options.no_gradient)


def _record(
    parser: argparse.ArgumentParser, options: argparse.Namespace, episode: _Episode
) -> None:
    from DroneSwarmSearch.rendering.painter import Painter

    path, first = options.record, episode.frame
    print(f"recording to {path}, at most {first.timestep_limit} steps ...", file=sys.stderr)
    reason = episode.search.reason if first.scale else ""
    painter = Painter(first.grid_size, _look(options), reason=reason)
    try:
        write_video(path, painter, episode.frames(), fps=options.fps, hold=2.0)
    except (ImportError, ValueError) as error:
        parser.error(f"argument --record: {error}")
    except OSError as error:
        parser.exit(1, f"cannot write {path}: {error.strerror or error}\n")


def _play_in_window(
    parser: argparse.ArgumentParser, options: argparse.Namespace, search: NamedSearch
) -> bool:
    """Play episodes in a window until the user closes it; returns whether one could be opened."""
    from DroneSwarmSearch.rendering.player_window import PlayerWindow

    sentence = search.reason if search.scale else ""
    window = PlayerWindow(search.scenario.grid_size, _look(options), sentence)
    try:
        window.open()
    except RuntimeError as error:
        reason = error.__cause__ or error
        if options.manual:
            parser.error(f"--manual needs a display, and no window can be opened ({reason})")
        print(f"no window can be opened ({reason}): showing text", file=sys.stderr)
        return False
    played: list[tuple[int, Recording]] = []

    def report(stopped: str = "") -> None:
        seed, recording = played[-1]
        _print_summary(search, options, seed, recording.frames[recording.seen], stopped)

    def begin(seed: int) -> Recording:
        if played and played[-1][1].end_was_seen:
            report()
            print()
        episode = _Episode(search, options, seed)
        title = f"{search.name}, {episode.frame.policy}, "
        if options.manual:
            names = RIVALS if options.hide_person else ()
            rivals = (_Episode(search, options, seed, name) for name in names)
            scores = (Score(rival.frame.policy, list(rival.frames())[-1]) for rival in rivals)
            recording = Recording(iter([episode.frame]), title, fly=episode.step, rivals=scores)
        else:
            recording = Recording(episode.frames(), title)
        played.append((seed, recording))
        return recording

    try:
        report(window.play(Player(begin, seed=options.seed, fps=options.fps)))
    finally:
        window.close()
    return True
