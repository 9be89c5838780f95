"""A player of searches: the moment that it shows, and what its keys do. It needs no display.

`player_window` draws a player, and gives it the keys and the time.
"""

from __future__ import annotations

import math
import threading
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass, replace
from typing import NamedTuple

from DroneSwarmSearch.frame import Frame
from DroneSwarmSearch.rendering.labels import outcome_in_brief
from DroneSwarmSearch.rules import OFF_GRID, Action, neighbours

__all__ = [
    "SCORE_HEADERS",
    "Flight",
    "KeyHelp",
    "Moment",
    "Player",
    "Recording",
    "Score",
    "refusal",
    "score_row",
]

SPEEDS = (0.25, 0.5, 1.0, 2.0, 4.0, 8.0)
"""Factors on the steps per second."""

STEP_RATE = 8.0
"""Steps per second at which single steps and moves by hand are drawn."""

HINT_SECONDS = 2.5

YOU = "you (drone 0)"

FLIGHT_KEYS = {
    **{"left": Action.LEFT, "a": Action.LEFT, "right": Action.RIGHT, "d": Action.RIGHT},
    **{"up": Action.UP, "w": Action.UP, "down": Action.DOWN, "s": Action.DOWN},
    **{"space": Action.SEARCH, "i": Action.IDLE, ".": Action.IDLE},
}
"""Actions of drone 0 by the names of keys, as pygame names them."""

REPEATING = frozenset({*FLIGHT_KEYS, ",", "up", "down"})
"""Keys that act again while they are held down."""


class KeyHelp(NamedTuple):
    """A line on the screen about keys."""

    keys: str
    meaning: str
    details: str


_ON_BOTH = (
    KeyHelp("P", "prior", "show the prior beside the posterior, or only the map of the drones"),
    KeyHelp("N", "new seed", "search again with the next seed: another drift"),
)
_AT_LAST = (
    KeyHelp("H", "keys", "show or hide this list"),
    KeyHelp("Esc", "quit", "close the window; also Q and, at the end, Enter"),
)
_WATCHING = (
    KeyHelp("Space", "play, pause", "pause or resume; at the end, play again"),
    KeyHelp("Left, Right", "step", "one step back or forward"),
    KeyHelp("Up, Down", "speed", "faster or slower; also + and -"),
)
_REPLAY = KeyHelp("R", "replay", "play again; Home and End jump to the first and last step")
_FLY_AGAIN = KeyHelp("R", "fly again", "fly the same search again")
_FLYING = (
    KeyHelp("Arrows", "fly drone 0", "move drone 0 to the next cell; also W, A, S, D"),
    KeyHelp("Space", "search", "search the cell of drone 0"),
    KeyHelp("I", "wait", "wait for a step; also the period key"),
)


class Score(NamedTuple):
    """The result of a searcher: a name, and the last frame of the episode."""

    name: str
    last: Frame


SCORE_HEADERS = ("", "result", "POS", "return")


def score_row(score: Score) -> tuple[str, str, str, str]:
    """A score as the cells of a table, below `SCORE_HEADERS`."""
    success, total = score.last.probability_of_success, score.last.total_return
    return (
        score.name,
        outcome_in_brief(score.last),
        "" if success is None else f"{success:.1%}",
        "" if total is None else f"{total:,.0f}",
    )


class Recording:
    """The frames of a policy's episode so far, which a thread plays.

    Some policies plan for seconds; meanwhile, the window stays alive.

    Args:
        frames: the frames of the episode, from that of the reset.
        title: what is shown, in a few words.

    Attributes:
        frames: those recorded so far.
        seen: the number of the latest frame that was shown.
        title: what is shown.
        scores: the results to show at the end; empty if there are no others.
    """

    flies = False
    """Whether the next step needs an action for drone 0."""

    def __init__(self, frames: Iterator[Frame], title: str = "") -> None:
        self.frames = [next(frames)]
        self.seen = 0
        self.title = title
        self.scores: Sequence[Score] = ()
        self._stopped = False
        self._error: BaseException | None = None
        threading.Thread(target=self._record, args=(frames,), daemon=True).start()

    def _record(self, frames: Iterator[Frame]) -> None:
        try:
            for frame in frames:
                if self._stopped:
                    return
                self.frames.append(frame)
        except BaseException as error:  # `show` raises it in the thread of the player
            self._error = error

    @property
    def has_ended(self) -> bool:
        """Whether the last frame of the episode has been recorded."""
        return self.frames[-1].ending is not None

    @property
    def end_was_seen(self) -> bool:
        """Whether the last frame of the episode has been shown."""
        return self.frames[self.seen].ending is not None

    def show(self, number: int) -> None:
        """Note that a frame is shown.

        Raises:
            Exception: the policy or the environment has failed after this frame.
        """
        self.seen = max(self.seen, number)
        if self._error is not None and number == len(self.frames) - 1:
            raise self._error

    def stop(self) -> None:
        """Record no further frames."""
        self._stopped = True


class Flight(Recording):
    """An episode in which the keys fly drone 0.

    Args:
        first: the frame of the reset.
        fly: plays one step with an action for drone 0, and returns its frame.
        title: what is shown, in a few words.
        rivals: the results of others in the same search, called at the end.
    """

    def __init__(
        self,
        first: Frame,
        fly: Callable[[Action], Frame],
        title: str = "",
        rivals: Callable[[], Sequence[Score]] = list,
    ) -> None:
        super().__init__(iter([first]), title)
        self._fly = fly
        self._rivals = rivals

    @property
    def flies(self) -> bool:  # type: ignore[override]
        return not self.has_ended

    def fly(self, action: Action) -> None:
        """Play one step."""
        self.frames.append(self._fly(action))
        if self.has_ended and (rivals := self._rivals()):
            self.scores = [Score(YOU, self.frames[-1]), *rivals]


@dataclass(frozen=True)
class Moment:
    """What a picture shows: the way from one frame to the next.

    Attributes:
        frame: the frame that the drones are flying to, or have reached.
        previous: the frame before it; None before the first step.
        progress: the part of the way, from 0 to 1.
        view: "matrix", what the drones see, or "both", the prior and the posterior.
    """

    frame: Frame
    previous: Frame | None
    progress: float
    view: str


class Player:
    """Plays recordings: forward, step by step, and back.

    Args:
        begin: starts the recording of the search with a seed.
        seed: of the first search.
        fps: steps per second at normal speed.

    Attributes:
        recording: of the search that is shown.
        seed: its seed.
        view: "matrix", what the drones see, or "both", the prior and the posterior.
        speed: factor on the steps per second.
        shows_keys: whether the list of keys is shown.
        quits: whether the user has asked to quit.
    """

    def __init__(
        self,
        begin: Callable[[int], Recording],
        *,
        seed: int,
        fps: float,
    ) -> None:
        self._begin = begin
        self._fps = fps
        self.view = "matrix"
        self.speed = 1.0
        self.shows_keys = False
        self.quits = False
        self._hint, self._hint_left = "", 0.0
        self._start(seed)

    def _start(self, seed: int) -> None:
        self.seed = seed
        self.recording = self._begin(seed)
        self._was_flown = self.recording.flies
        self._position = 0.0  # in steps; a fraction is the part of the way to the next frame
        self._goal = math.inf  # where the picture stops; infinite while playing
        self._hint_left = 0.0

    # What is shown.

    @property
    def moment(self) -> Moment:
        """What to draw."""
        number = math.ceil(self._position)
        frames = self.recording.frames
        frame = frames[number]
        if frame.hide_persons and self.recording.end_was_seen:
            frame = replace(frame, hide_persons=False)
        if number == 0:
            return Moment(frame, None, 1.0, self.view)
        return Moment(frame, frames[number - 1], self._position - number + 1, self.view)

    @property
    def is_at_end(self) -> bool:
        """Whether the last frame of the episode is shown."""
        return self.recording.has_ended and self._position == len(self.recording.frames) - 1

    @property
    def is_paused(self) -> bool:
        """Whether the recording stands still at a step before its end."""
        return not (self.recording.flies or self.is_at_end) and self._goal < math.inf

    @property
    def status(self) -> str:
        """What is shown, and how, in a line."""
        parts = [f"{self.recording.title}seed {self.seed}"]
        if not self.recording.flies:
            parts.append(f"speed {self.speed:g}\N{MULTIPLICATION SIGN}")
            if self.is_at_end:
                parts.append("the end: Enter closes the window")
            elif self.is_paused:
                parts.append("paused")
            elif self._waits_for_policy:
                parts.append("the policy is planning ...")
        return "   ".join(parts)

    @property
    def _waits_for_policy(self) -> bool:
        caught_up = self._position == len(self.recording.frames) - 1
        return caught_up and not self.recording.has_ended

    @property
    def hint(self) -> str:
        """Why the last key did nothing; empty after some seconds."""
        return self._hint if self._hint_left > 0.0 else ""

    @property
    def keys(self) -> tuple[KeyHelp, ...]:
        """The keys that do something now, the most important ones first."""
        if self.recording.flies:
            return (*_FLYING, *_ON_BOTH, _FLY_AGAIN, *_AT_LAST)
        again = _FLY_AGAIN if self._was_flown else _REPLAY
        return (*_WATCHING, again, *_ON_BOTH, *_AT_LAST)

    # Keys and time.

    def press(self, key: str, *, repeated: bool = False) -> None:
        """React to a key.

        Args:
            key: its name, as `pygame.key.name` returns it.
            repeated: whether it is held down and has acted before.
        """
        if repeated and key not in REPEATING:
            return
        if key in ("escape", "q") or (key == "return" and self.is_at_end):
            self.quits = True
        elif key in ("p", "tab"):
            self.view = "both" if self.view == "matrix" else "matrix"
        elif key == "h":
            self.shows_keys = not self.shows_keys
        elif key == "n":
            self._begin_again(self.seed + 1)
        elif key == "r" and self._was_flown:
            self._begin_again(self.seed)
        elif self.recording.flies:
            if key in FLIGHT_KEYS:
                self._fly(FLIGHT_KEYS[key])
        else:
            self._scrub(key)

    def _begin_again(self, seed: int) -> None:
        self.recording.stop()
        self._start(seed)

    def _fly(self, action: Action) -> None:
        assert isinstance(self.recording, Flight)
        frames = self.recording.frames
        reason = refusal(frames[-1], action)
        if reason:
            self._hint, self._hint_left = reason, HINT_SECONDS
            return
        self._hint_left = 0.0
        self._position = len(frames) - 1.0  # the last move is complete
        self.recording.fly(action)

    def _scrub(self, key: str) -> None:
        if key == "r" or (key == "space" and self.is_at_end):
            if not self._was_flown:  # whoever still presses the search key would miss the result
                self._position, self._goal = 0.0, math.inf
        elif key == "space":
            self._goal = math.ceil(self._position) if self._goal == math.inf else math.inf
        elif key in ("right", "."):
            start = math.floor(self._position) if self._goal == math.inf else self._goal
            # The next frame may not be recorded yet.
            last = len(self.recording.frames) - self.recording.has_ended
            self._goal = min(start + 1, last)
        elif key in ("left", ","):
            self._position = self._goal = max(math.ceil(self._position) - 1, 0)
        elif key == "home":
            self._position = self._goal = 0
        elif key == "end":
            self._position = self._goal = len(self.recording.frames) - 1
        elif key in ("up", "+", "="):
            self.speed = min((each for each in SPEEDS if each > self.speed), default=SPEEDS[-1])
        elif key in ("down", "-"):
            self.speed = max((each for each in SPEEDS if each < self.speed), default=SPEEDS[0])

    def advance(self, seconds: float) -> None:
        """Let time pass."""
        self._hint_left -= seconds
        by_hand = self._was_flown and not self.recording.end_was_seen
        goal = min(math.inf if by_hand else self._goal, len(self.recording.frames) - 1)
        if by_hand or self.is_paused:
            rate = STEP_RATE * max(1.0, goal - self._position)
        else:
            rate = self._fps * self.speed
        if self._position < goal:
            self._position = min(goal, self._position + seconds * rate)
        self.recording.show(math.ceil(self._position))


def refusal(frame: Frame, action: Action) -> str:
    """Why drone 0 may not take an action; empty if it may.

    By the rules of the environment, leaving the grid and collisions end the episode. By hand,
    both happen by mistake, so these moves are refused.
    """
    size = frame.grid_size
    x, y = frame.drones[0]
    ahead = neighbours(y * size + x, size)[action]
    if ahead == OFF_GRID:
        return "the grid ends here"
    cell = ahead % size, ahead // size
    for number, other in enumerate(frame.drones[1:], 1):
        if other == cell:
            return f"drone {number} is there"
    return ""
