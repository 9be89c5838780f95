"""The command `play`: watch a search in a window or a terminal, fly a drone, or record a video."""

from __future__ import annotations

import argparse
import sys
import textwrap
from collections.abc import Iterator
from dataclasses import replace
from pathlib import Path

from DroneSwarmSearch._internal import checks
from DroneSwarmSearch._internal.cells import cell_number, cell_position
from DroneSwarmSearch.commands.evaluation import add_view, view_from
from DroneSwarmSearch.commands.searches import check_drone, named_search
from DroneSwarmSearch.core.frame import Frame
from DroneSwarmSearch.core.grid import OFF_GRID, Grid
from DroneSwarmSearch.core.named_search import NamedSearch
from DroneSwarmSearch.core.observations import Observation
from DroneSwarmSearch.core.rules import Action
from DroneSwarmSearch.env import DroneSwarmSearch
from DroneSwarmSearch.evaluation.policy_spec import PolicySpec
from DroneSwarmSearch.evaluation.recording import frames_by_drone, record
from DroneSwarmSearch.evaluation.stage import prepared, steering, view_of
from DroneSwarmSearch.policies import POLICIES
from DroneSwarmSearch.rendering.palette import PALETTES, Look
from DroneSwarmSearch.rendering.player import Player, Recording, Score
from DroneSwarmSearch.rendering.text import WIDTH, print_frames
from DroneSwarmSearch.rendering.video import FPS_LEAST, FPS_MOST, SUFFIXES

USUAL_POLICY = "greedy-forecast"  # as good as any that start at once
BESIDE_YOU = "greedy-matrix"  # it needs only observations, so it works while you fly drone 0

# Flights by hand are compared with these policies, all of which are quick.
RIVALS = ("greedy-matrix", "greedy-posterior", "greedy-forecast", "parallel-sweep")

# found after a third of the time
USUAL_SEARCH = "man-overboard"
USUAL_SEED = 7


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """The options of the command."""
    parser.usage = "%(prog)s [SEARCH] [options]"
    parser.set_defaults(names={"search": "SEARCH"})
    parser.add_argument(
        "search",
        metavar="SEARCH",
        nargs="?",
        help="a search of the suite, such as classic or gale (`evaluate --list` describes them), "
        "a file of a search or an incident, .json, or a search of the benchmark, such as drift/0 "
        f"(default: {USUAL_SEARCH})",
    )
    view = parser.add_argument_group("view (a window if there is a display, otherwise text)")
    where = view.add_mutually_exclusive_group().add_argument
    where("--manual", action="store_true", help="fly drone 0 with the arrow keys")
    where("--text", action="store_true", help="stay in the terminal")
    where("--record", metavar="FILE", type=Path, help="write a video instead, .gif or .mp4")
    add = view.add_argument
    add("--hide-person", action="store_true", help="do not show missing persons")
    add("--fps", type=float, default=6.0, help="steps shown per second (default: 6)")
    add("--palette", choices=PALETTES, default="sea", help="the map's colours (default: sea)")
    add("--drone", metavar="K", type=int, help="show what drone K knows, in a search with radios")

    policies = f"{', '.join(POLICIES)}, or your own as for `evaluate` (default: {USUAL_POLICY})"
    add_view(parser)
    add = parser.add_argument_group("episode").add_argument
    add("--policy", metavar="NAME", help=policies)
    seed = f"of the persons' drift (default: 0; without SEARCH {USUAL_SEED})"
    add("--seed", metavar="N", type=int, help=seed)


def run(options: argparse.Namespace) -> None:
    """Play a search as the options say."""
    if options.manual and options.policy is not None:
        raise ValueError(f"--manual: the other drones use {BESIDE_YOU}: leave out --policy")
    if options.record is not None and options.hide_person:
        raise ValueError("--hide-person cannot be given together with --record")
    if options.text and "palette" in options.given:
        raise ValueError("--palette cannot be given together with --text, which has no colours")
    options.policy = options.policy or (BESIDE_YOU if options.manual else USUAL_POLICY)
    if options.seed is None:
        options.seed = USUAL_SEED if options.search is None else 0
    checks.integer("--seed", options.seed, 0)
    checks.real("--fps", options.fps, FPS_LEAST, FPS_MOST)
    if options.record is not None:
        checks.suffix("--record", options.record, SUFFIXES)
    found = named_search(options.search or USUAL_SEARCH)
    check_drone(options.drone, found)
    options.spec = PolicySpec.of(options.policy)
    print(textwrap.fill(f"{found.name}: {found.reason}", WIDTH) + "\n", flush=True)
    if options.record is not None:
        video = record(
            options.spec,
            found,
            options.record,
            seed=options.seed,
            view=view_from(options),
            fps=options.fps,
            palette=options.palette,
            drone=options.drone,
        )
        last = video.last
    elif options.text or not _play_in_window(options, found):
        episode = _Episode(found, options, options.seed)
        shown = (frame.seen_by(options.drone) for frame in episode.frames())
        print_frames(shown, options.fps)
        last = episode.frame
    else:
        return
    _print_summary(found, options, options.seed, last)


class _Episode:
    """A search from its reset to its end, flown by a rival, or else as the options say.

    Attributes:
        frame: the current one; its policy names who flies the drones.
        search: what is played.
    """

    def __init__(
        self, search: NamedSearch, options: argparse.Namespace, seed: int, rival: str = ""
    ) -> None:
        spec = PolicySpec.of(rival or options.spec)
        posterior = search.with_posterior(bayesian_update=True)
        seen = view_of(spec, search, view_from(options))
        where = posterior if options.manual else search.with_posterior(seen.bayesian_update)
        self._flown = 0 if options.manual and not rival else None
        self._label = spec.name if self._flown is None else f"you and {spec.name}"
        self._policy = prepared(spec, where)
        self._act = steering(self._policy, where, seed, seen)
        self._hide_person = options.hide_person
        self.search = search
        self._env = DroneSwarmSearch(scenario=posterior.scenario, render_mode=None)
        self._observations, _ = self._env.reset(seed, drones_positions=search.drones)
        self.frame = self._current_frame()

    def step(self, action: Action | None = None) -> Frame:
        """Play a step with the policy's actions, or another one for drone 0; return its frame."""
        if action is None:
            actions = self._act()
        else:
            # Shown drone 0 where its action leads, the policy keeps the others away.
            (x, y), matrix = self._observations["drone0"]["observation"]
            size = len(matrix)
            ahead = Grid.of(size).neighbours[cell_number(x, y, size)][action]
            if ahead != OFF_GRID:
                x, y = cell_position(ahead, size)
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
        frame = replace(frame, policy=self._label, hide_persons=hides, flown=self._flown)
        frame = replace(frame, scale=self.search.scale, land=self.search.land)
        return replace(frame, by_drone=frames_by_drone(self._env))


def _print_summary(
    search: NamedSearch, options: argparse.Namespace, seed: int, frame: Frame, stopped: str = ""
) -> None:
    """Print the result of an episode by its last frame, and why the user stopped it there."""
    policy = options.policy
    outcome = f"stopped: {stopped}"
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
        success = f"{frame.probability_of_success:.1%} of all persons would be found by now"
        lines.append(f"POS             {success}")
    if search.scale is not None:
        cell = search.scale.metres_per_cell
        step = search.scale.seconds_per_step
        lines.append(f"scale           cells of {cell:g} m, steps of {step:.3g} s")
    print("\n".join(lines), flush=True)


def _play_in_window(options: argparse.Namespace, search: NamedSearch) -> bool:
    """Play episodes in a window until the user closes it; returns whether one could be opened."""
    from DroneSwarmSearch.rendering.player_window import PlayerWindow

    sentence = search.reason if search.scale else ""
    window = PlayerWindow(
        search.scenario.grid_size, Look(grid=True, palette=options.palette), sentence
    )
    try:
        window.open()
    except RuntimeError as error:
        reason = error.__cause__ or error
        if options.manual:
            raise ValueError(
                f"--manual needs a display, and no window can be opened ({reason})"
            ) from error
        print(f"no window can be opened ({reason}): showing text", file=sys.stderr)
        return False
    played: list[tuple[int, Recording]] = []

    def show_result(stopped: str = "") -> None:
        seed, recording = played[-1]
        _print_summary(search, options, seed, recording.frames[recording.seen], stopped)

    def begin(seed: int) -> Recording:
        if played and played[-1][1].end_was_seen:
            show_result()
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
        show_result(
            window.play(Player(begin, seed=options.seed, fps=options.fps, viewer=options.drone))
        )
    finally:
        window.close()
    return True
