"""The demo: a search in a window, in the terminal or as a film."""

from __future__ import annotations

import argparse
import math
import os
import re
import shutil
import sys
import textwrap
import time
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from itertools import chain
from pathlib import Path
from typing import TYPE_CHECKING, NoReturn

from DroneSwarmSearch.env import DroneSwarmSearch
from DroneSwarmSearch.observations import Observation
from DroneSwarmSearch.policies import POLICIES, Policy, make
from DroneSwarmSearch.policies.ppo import Network
from DroneSwarmSearch.rendering.film import SUFFIXES, write_film
from DroneSwarmSearch.rendering.frame import Frame
from DroneSwarmSearch.rendering.text import render_text
from DroneSwarmSearch.rules import OFF_GRID, Action, neighbours
from DroneSwarmSearch.scenario import Cell

if TYPE_CHECKING:
    import pygame

    from DroneSwarmSearch.rendering.painter import Painter
    from DroneSwarmSearch.rendering.window import Window

__all__ = ["main"]

DESCRIPTION = """\
Drones search a grid at sea for shipwrecked persons who drift. They start around the
border, the persons in the middle. Every drone goes for the cell that is worth most for
its distance (the policy "greedy-matrix"), unless you choose another policy or fly the
first one yourself.
"""

EPILOG = """\
keys in the window: Esc or Q quits. With --manual also: arrow keys move drone 0, space
searches its cell, i or . idles; every key is one step for all drones. Mind the border and
the other drones: leaving the grid and collisions end the search.
"""

TITLE = "Drone swarm search"
TITLE_MANUAL = f"{TITLE}: arrows move drone 0, space searches, i idles, Esc quits"

HOLD_WINDOW = 3.0
HOLD_FILM = 2.0
"""Seconds for which the end screen stays."""

PRINTED_FRAMES = 5
PRINTED_STRIDE = 10
"""Where the output is no terminal: so many frames between the first and the last, at
most, and no nearer to each other than this number of steps."""

POLL = 50
"""Milliseconds between looks for Ctrl-C while waiting for a key."""

FPS_LEAST, FPS_MOST = 0.1, 50.0
"""The most is what a GIF can do."""

USUAL_POLICY = "greedy-matrix"
"""It looks at what it is shown alone, so that it can fly beside a person at the keys."""

OPTIONS = {
    "grid_size": "--grid-size",
    "n_drones": "--drones",
    "vector": "--vector",
    "disperse_constant": "--disperse-constant",
    "timestep_limit": "--timestep-limit",
    "probability_of_detection": "--probability-of-detection",
    "seed": "--seed",
    "name": "--policy",
}
"""Which option sets a parameter of the environment, or of what makes the policy."""

INTERRUPTED = 130
"""Exit code after Ctrl-C, as shells have it."""


class _QuitError(Exception):
    """The user wants no more of the episode; the message says how that came."""


def main(argv: Sequence[str] | None = None) -> int:
    """Run the demo.

    Args:
        argv: the command line's arguments; those of the process if None.

    Returns:
        The exit code: 0, or 130 after Ctrl-C.

    Raises:
        SystemExit: help was asked for (code 0), or an option cannot be met (code 2).
    """
    parser = _parser()
    options = parser.parse_args(argv)
    if options.manual and (options.text or options.record):
        parser.error("argument --manual: needs the window, so not with --text or --record")
    if options.manual and options.policy != USUAL_POLICY:
        parser.error(
            f"argument --manual: the other drones fly by {USUAL_POLICY}, so not with --policy"
        )
    try:
        return _run(parser, options)
    except KeyboardInterrupt:
        print("\ninterrupted", file=sys.stderr)
        return INTERRUPTED
    except BrokenPipeError:
        # Whoever read the output has gone; what Python still holds of it must not fail too.
        os.dup2(os.open(os.devnull, os.O_WRONLY), sys.stdout.fileno())
        return 1


# The command line.


def _parser() -> argparse.ArgumentParser:
    parser = argparse.ArgumentParser(
        prog=_program(),
        description=DESCRIPTION,
        epilog=EPILOG,
        formatter_class=_HelpFormatter,
    )
    flag = argparse.BooleanOptionalAction
    ways = parser.add_argument_group("how to watch (a window if there is a display, else text)")
    ways.add_argument("--manual", action="store_true", help="fly drone 0 with the arrow keys")
    ways.add_argument("--text", action="store_true", help="stay in the terminal")
    ways.add_argument(
        "--record", metavar="FILE", type=_film, help="write a film instead, .gif or .mp4"
    )
    ways.add_argument("--fps", type=_rate, default=6.0, help="steps shown per second")
    ways.add_argument("--grid", action=flag, default=True, help="draw lines between the cells")
    ways.add_argument("--gradient", action=flag, default=True, help="colour the cells smoothly")
    ways.add_argument(
        "--prior",
        action="store_true",
        help="show (and tell the drones) where the drift takes the persons, whatever was"
        " searched, not the posterior given the searches",
    )
    search = parser.add_argument_group("the search")
    search.add_argument(
        "--policy",
        metavar="NAME",
        type=_steering,
        default=USUAL_POLICY,
        help=f"what steers the drones: {', '.join(POLICIES)}, or weights of your own, .npz",
    )
    search.add_argument("--drones", metavar="N", type=int, default=4, help="number of drones")
    search.add_argument("--grid-size", metavar="N", type=int, default=20, help="cells along a side")
    search.add_argument("--persons", metavar="N", type=_count, default=1, help="number of persons")
    search.add_argument(
        "--vector",
        metavar=("X", "Y"),
        nargs=2,
        type=float,
        default=(0.2, 0.1),
        help="drift in cells per step, y downward",
    )
    search.add_argument(
        "--disperse-constant",
        metavar="C",
        type=float,
        default=3.0,
        help="how quickly the persons stray from the drift, at least 0",
    )
    search.add_argument(
        "--timestep-limit", metavar="N", type=int, default=100, help="steps, at most"
    )
    search.add_argument(
        "--probability-of-detection",
        metavar="P",
        type=float,
        default=1.0,
        help="chance that a search of the right cell finds the person, 0 to 1",
    )
    search.add_argument(
        "--seed", metavar="N", type=int, default=12, help="another seed, another drift"
    )
    return parser


class _HelpFormatter(argparse.ArgumentDefaultsHelpFormatter):
    """Tells the defaults of options that take a value; those of flags are plain."""

    def _get_help_string(self, action: argparse.Action) -> str | None:
        if action.nargs == 0 or action.default is None:
            return action.help
        return super()._get_help_string(action)


def _program() -> str | None:
    """The program's name in messages; None leaves it to argparse."""
    started_as = Path(sys.argv[0]).name if sys.argv else ""
    return "python -m DroneSwarmSearch" if started_as == "__main__.py" else None


def _film(text: str) -> Path:
    path = Path(text)
    if path.suffix.lower() not in SUFFIXES:
        raise argparse.ArgumentTypeError(f"must end in {' or '.join(SUFFIXES)}, got {text!r}")
    return path


def _steering(text: str) -> str:
    if text.endswith(".npz"):
        try:
            Network.load(text)
        except FileNotFoundError:
            raise argparse.ArgumentTypeError(f"there is no file {text!r}") from None
        except ValueError as error:
            raise argparse.ArgumentTypeError(str(error)) from None
    return text


def _within(
    kind: Callable[[str], float], least: float, most: float, words: str
) -> Callable[[str], float]:
    """Reads a number within some limits, which the words tell in case of a fault."""

    def read(text: str) -> float:
        try:
            value = kind(text)
        except ValueError:
            value = math.nan
        if not least <= value <= most:
            raise argparse.ArgumentTypeError(f"must be {words}, got {text!r}")
        return value

    return read


_rate = _within(float, FPS_LEAST, FPS_MOST, f"a number from {FPS_LEAST:g} to {FPS_MOST:g}")
_count = _within(int, 1, math.inf, "an integer of at least 1")


def _refuse(parser: argparse.ArgumentParser, error: Exception) -> NoReturn:
    """Report what is said of a parameter as a fault of the option."""
    match = re.match(r"(\w+)(?:\[\d+\])? ", str(error))
    if match is None or match[1] not in OPTIONS:
        raise error
    parser.error(f"argument {OPTIONS[match[1]]}: {str(error)[match.end() :]}")


# The episode.


class _Episode:
    """A search from reset to end, and what is to be told of it afterwards.

    Args:
        options: the command line's.

    Raises:
        TypeError, ValueError: an option is out of its limits.
    """

    def __init__(self, options: argparse.Namespace) -> None:
        size: int = options.grid_size
        self.env = DroneSwarmSearch(
            grid_size=size,
            render_mode=None,
            n_drones=options.drones,
            vector=options.vector,
            person_initial_position=[(size // 2, size // 2)] * options.persons,
            disperse_constant=options.disperse_constant,
            timestep_limit=options.timestep_limit,
            probability_of_detection=options.probability_of_detection,
            bayesian_update=not options.prior,
        )
        steering = make(options.policy, self.env.scenario)
        self._observations, _ = self.env.reset(
            options.seed, drones_positions=_around_the_border(options.drones, size)
        )
        steering.reset(seed=options.seed)
        self.policy: Policy = steering
        self._total = 0.0
        self._seconds = 0.0

    def frames(self) -> Iterator[Frame]:
        """Play the episode and yield every frame of it, the first one included."""
        env = self.env
        yield env.frame()
        while env.agents:
            actions = self.policy(self._observations)
            began = time.perf_counter()
            self._observations, rewards, _, _, _ = env.step(actions)
            self._seconds += time.perf_counter() - began
            self._total += rewards["total_reward"]
            yield env.frame()

    def summary(self, stopped: str = "") -> str:
        """How it went, in some lines; `stopped` says why it ended early."""
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
            lines.append(
                f"speed          {frame.step / self._seconds:,.0f} steps/s (the environment alone)"
            )
        return "\n".join(lines)


def _around_the_border(n_drones: int, grid_size: int) -> list[Cell] | None:
    """Start cells evenly spread around the border, clockwise from (0, 0).

    None, which leaves it to the environment, if there are more drones than such cells.
    """
    last = grid_size - 1
    border = [
        *((i, 0) for i in range(last)),
        *((last, i) for i in range(last)),
        *((last - i, last) for i in range(last)),
        *((0, last - i) for i in range(last)),
    ]
    if not 1 <= n_drones <= len(border):
        return None
    return [border[drone * len(border) // n_drones] for drone in range(n_drones)]


def _run(parser: argparse.ArgumentParser, options: argparse.Namespace) -> int:
    """Play one episode as the options ask, and tell how it went."""
    try:
        episode = _Episode(options)
    except (TypeError, ValueError) as error:
        _refuse(parser, error)
    stopped = ""
    try:
        if options.record:
            _record(parser, episode, options)
        elif options.text:
            _show_as_text(episode.frames(), options.fps)
        else:
            _show_in_window(parser, episode, options)
    except _QuitError as reason:
        stopped = str(reason)
    print(episode.summary(stopped), flush=True)
    return 0


# Film.


def _record(
    parser: argparse.ArgumentParser, episode: _Episode, options: argparse.Namespace
) -> None:
    path: Path = options.record
    try:
        _probe(path)
        print(
            f"recording to {path}, at most {episode.env.timestep_limit} steps ...", file=sys.stderr
        )
        painter = _painter(options)
        write_film(path, map(painter.pixels, episode.frames()), fps=options.fps, hold=HOLD_FILM)
    except ImportError as error:
        _give_up(parser, str(error))
    except OSError as error:
        _give_up(parser, f"cannot write {path}: {error.strerror or error}")


def _probe(path: Path) -> None:
    """Fail before the episode rather than after it if the file cannot be written."""
    existed = path.exists()
    with path.open("ab"):
        pass
    if not existed:
        path.unlink()


def _give_up(parser: argparse.ArgumentParser, message: str) -> NoReturn:
    parser.exit(2, f"{parser.prog}: error: {message}\n")
    raise AssertionError("unreachable: the parser exits")


def _painter(options: argparse.Namespace) -> Painter:
    from DroneSwarmSearch.rendering.painter import Painter

    return Painter(options.grid_size, render_grid=options.grid, render_gradient=options.gradient)


# Text.


def _show_as_text(frames: Iterable[Frame], fps: float) -> None:
    """Redraw the frames in place on a terminal, or print some of them to anything else."""
    if sys.stdout.isatty():
        _animate(frames, fps)
        return
    for frame in frames:
        between = max(PRINTED_STRIDE, math.ceil(frame.timestep_limit / PRINTED_FRAMES))
        if frame.ending is not None or frame.step % between == 0:
            print(render_text(frame) + "\n", flush=True)


def _animate(frames: Iterable[Frame], fps: float) -> None:
    """Draw every frame over the one before."""
    height, due = 0, time.monotonic()
    try:
        for frame in frames:
            *lines, last = _fitted(frame, *shutil.get_terminal_size())
            to_the_top = f"\r\x1b[{height}A" if height else "\r"
            # Lines are wiped before they are written: wiping a full line's end would take
            # its last character.
            sys.stdout.write(to_the_top)
            sys.stdout.writelines(f"\x1b[2K{line}\n" for line in lines)
            sys.stdout.write(f"\x1b[J{last}")
            sys.stdout.flush()
            height = len(lines)
            if frame.ending is None:
                due += 1 / fps
                time.sleep(max(0.0, due - time.monotonic()))
    finally:
        print("\n")


def _fitted(frame: Frame, columns: int, rows: int) -> list[str]:
    """The frame as text for a terminal; if that is too small, the likeliest part of it."""
    lines = render_text(frame, columns).split("\n")
    size = frame.grid_size
    header, board, legend = lines[: -size - 2], lines[-size - 2 : -1], lines[-1]
    header = [part for line in header for part in textwrap.wrap(line, columns)]
    footer = textwrap.wrap(legend, columns)

    margin = len(str(size - 1)) + 1
    width = (len(board[-1]) - margin) // size
    left, right = _around(int(frame.matrix.max(axis=0).argmax()), size, (columns - margin) // width)
    top, bottom = _around(
        int(frame.matrix.max(axis=1).argmax()), size, rows - len(header) - 1 - len(footer)
    )
    board = [
        line[:margin] + line[margin + left * width : margin + right * width]
        for line in (board[0], *board[1 + top : 1 + bottom])
    ]
    return [*header, *board, *footer][:rows]


def _around(centre: int, size: int, room: int) -> tuple[int, int]:
    """As many of the cells 0 to `size` - 1 as there is room for: the first, and past the last."""
    room = min(max(1, room), size)
    first = min(max(0, centre - room // 2), size - room)
    return first, first + room


# Window.


def _show_in_window(
    parser: argparse.ArgumentParser, episode: _Episode, options: argparse.Namespace
) -> None:
    """Play in a window, or as text where there is none to be had."""
    from DroneSwarmSearch.rendering.window import Window

    title = TITLE_MANUAL if options.manual else TITLE
    window = Window(_painter(options), title=title, fps=options.fps)
    if options.manual:
        episode.policy = _Pilot(episode.policy, options.grid_size, lambda: _wait_for_key(window))
    frames = episode.frames()
    first = next(frames)
    try:
        window.show(first)
    except RuntimeError as error:
        reason = error.__cause__ or error
        if options.manual:
            _give_up(parser, f"--manual needs a display, and no window can be opened ({reason})")
        print(f"no window can be opened ({reason}): here it is as text", file=sys.stderr)
        _show_as_text(chain([first], frames), options.fps)
        return
    if options.manual:
        print(EPILOG, flush=True)
    try:
        for frame in frames:
            if not options.manual:  # else the pilot does, and the keys are for it
                _heed_quitting(window)
            window.show(frame)
        _hold(window)
    finally:
        window.close()


class _Pilot:
    """You fly drone 0; a policy flies the others, and knows where drone 0 is going.

    Args:
        policy: for the others.
        grid_size: cells along each side.
        choose: waits for drone 0's action.
    """

    def __init__(self, policy: Policy, grid_size: int, choose: Callable[[], Action]) -> None:
        self._policy = policy
        self._grid_size = grid_size
        self._choose = choose

    def reset(self) -> None:
        """Forget the episode."""
        self._policy.reset()

    def __call__(self, observations: Mapping[str, Observation], /) -> dict[str, int]:
        """Your action for drone 0, the policy's for the others."""
        action = self._choose()
        (x, y), matrix = observations["drone0"]["observation"]
        ahead = neighbours(y * self._grid_size + x, self._grid_size)[action]
        if ahead != OFF_GRID:
            y, x = divmod(ahead, self._grid_size)
        # The policy keeps the others away from where it sees drone 0.
        seen: dict[str, Observation] = {**observations, "drone0": {"observation": ((x, y), matrix)}}
        return {**self._policy(seen), "drone0": int(action)}


def _wait_for_key(window: Window) -> Action:
    """The action of the next key that stands for one."""
    from DroneSwarmSearch.rendering._pygame import pygame

    keys = {
        pygame.K_LEFT: Action.LEFT,
        pygame.K_RIGHT: Action.RIGHT,
        pygame.K_UP: Action.UP,
        pygame.K_DOWN: Action.DOWN,
        pygame.K_SPACE: Action.SEARCH,
        pygame.K_i: Action.IDLE,
        pygame.K_PERIOD: Action.IDLE,
    }
    while True:
        event = _next_event(window, POLL)
        if event.type == pygame.KEYDOWN and event.key in keys:
            return keys[event.key]


def _heed_quitting(window: Window) -> None:
    """Look at all that has happened in the window since the last time."""
    from DroneSwarmSearch.rendering._pygame import pygame

    while _next_event(window, 0).type != pygame.NOEVENT:
        pass


def _hold(window: Window) -> None:
    """Leave the end screen for a while, or until the user quits."""
    until = time.monotonic() + HOLD_WINDOW
    try:
        while time.monotonic() < until:
            _next_event(window, POLL)
    except _QuitError:
        return


def _next_event(window: Window, timeout: int) -> pygame.event.Event:
    """What happened next in the window; NOEVENT if nothing did within some milliseconds.

    Raises:
        _QuitError: the user quits.
    """
    from DroneSwarmSearch.rendering._pygame import pygame

    if not window.is_open:
        raise _QuitError("the window was closed")
    event = pygame.event.wait(timeout) if timeout else pygame.event.poll()
    if event.type == pygame.QUIT:
        raise _QuitError("the window was closed")
    if event.type == pygame.KEYDOWN and event.key in (pygame.K_ESCAPE, pygame.K_q):
        raise _QuitError("you quit")
    if event.type == pygame.VIDEOEXPOSE:
        pygame.display.flip()
    return event
