"""A player of searches: what it shows, and what its keys do; `player_window` draws it."""

from __future__ import annotations

import math
import threading
from collections.abc import Callable, Iterable, Iterator, Sequence
from dataclasses import replace
from typing import NamedTuple

from DroneSwarmSearch.core.frame import Frame
from DroneSwarmSearch.core.grid import OFF_GRID, Grid
from DroneSwarmSearch.core.rules import Action

# factors on the steps per second
SLOWEST = 0.25
FASTEST = 8.0
STEP_RATE = 8.0  # steps per second at which single steps and moves by hand are drawn

# Actions of drone 0 by pygame's names of keys.
FLIGHT_KEYS = {
    **{"left": Action.LEFT, "a": Action.LEFT, "right": Action.RIGHT, "d": Action.RIGHT},
    **{"up": Action.UP, "w": Action.UP, "down": Action.DOWN, "s": Action.DOWN},
    **{"space": Action.SEARCH, "i": Action.IDLE, ".": Action.IDLE},
}

# Keys, and what they do.
WATCHING = (
    ("Space", "play, pause"),
    ("Left, Right", "step"),
    ("Home, End", "first, last"),
    ("Up, Down", "speed"),
)
FLYING = (("Arrows", "fly drone 0"), ("Space", "search"), ("I", "wait"))
ALWAYS = (("P", "prior"), ("N", "new seed"), ("Esc", "quit"))
BY_RADIO = (("M", "map of each drone"),)


class Score(NamedTuple):
    """The result of a searcher: a name, and the last frame of the episode."""

    name: str
    last: Frame


class Recording:
    """The frames of an episode so far; a thread plays on while a policy plans for seconds.

    `fly` plays a step with an action for drone 0, where keys fly it; `frames` then holds the first
    one only, and `rivals` give the results of others in the same search, taken at the end. Of
    `frames`, `seen` is the latest that was shown.
    """

    def __init__(
        self,
        frames: Iterator[Frame],
        title: str = "",
        *,
        fly: Callable[[Action], Frame] | None = None,
        rivals: Iterable[Score] = (),
    ) -> None:
        self.frames = [next(frames)]
        self.seen = 0
        self.title = title
        self.is_flight = fly is not None
        self.scores: Sequence[Score] = ()
        self._fly = fly
        self._rivals = rivals
        self.is_stopped = False
        self._error: BaseException | None = None
        threading.Thread(target=self._record, args=(frames,), daemon=True).start()

    def _record(self, frames: Iterator[Frame]) -> None:
        try:
            for frame in frames:
                if self.is_stopped:
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

    @property
    def flies(self) -> bool:
        """Whether the next step needs an action for drone 0."""
        return self.is_flight and not self.has_ended

    def fly(self, action: Action) -> None:
        assert self._fly is not None
        self.frames.append(self._fly(action))
        if self.has_ended and (rivals := list(self._rivals)):
            self.scores = [Score("you (drone 0)", self.frames[-1]), *rivals]

    def show(self, number: int) -> None:
        """Note that a frame is shown; the end reveals persons. Raises what the policy raised."""
        self.seen = max(self.seen, number)
        if self.end_was_seen and self.frames[0].hide_persons:
            self.frames = [replace(frame, hide_persons=False) for frame in self.frames]
        if self._error is not None and number == len(self.frames) - 1:
            raise self._error


class Player:
    """Plays recordings, which `begin` starts by their seed: forward, step by step, and back.

    `speed` is a factor on the steps per second, `fps`; `hint` says why the last key did nothing.
    `viewer` is the number of the drone whose map is shown, None for that of all together.
    """

    def __init__(
        self,
        begin: Callable[[int], Recording],
        *,
        seed: int,
        fps: float,
        viewer: int | None = None,
    ) -> None:
        self._begin = begin
        self._fps = fps
        self.viewer = viewer
        self.view = "matrix"
        self.speed = 1.0
        self.quits = False
        self.hint = ""
        self._start(seed)

    def _start(self, seed: int) -> None:
        self.seed = seed
        self.recording = self._begin(seed)
        self._position = 0.0  # in steps; a fraction is the part of the way to the next frame
        self._goal = math.inf  # where the picture stops; infinite while playing

    @property
    def moment(self) -> tuple[Frame, Frame | None, float]:
        """The last frame that was reached; on the way to the next one, this and the progress."""
        frames = self.recording.frames
        number = math.floor(self._position)
        progress = self._position - number
        after = frames[number + 1] if progress else None
        return frames[number].seen_by(self.viewer), after, progress

    @property
    def _is_at_last(self) -> bool:
        return self._position == len(self.recording.frames) - 1

    @property
    def is_at_end(self) -> bool:
        """Whether the last frame of the episode is shown."""
        return self.recording.has_ended and self._is_at_last

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
            elif self._is_at_last:
                parts.append("the policy is planning ...")
        return "   ".join(parts)

    @property
    def keys(self) -> tuple[tuple[str, str], ...]:
        """The keys that do something now, and what."""
        again = "R", "fly again" if self.recording.is_flight else "replay"
        by_radio = BY_RADIO if self._drones else ()
        return (*(FLYING if self.recording.flies else WATCHING), again, *by_radio, *ALWAYS)

    @property
    def _drones(self) -> int:
        """The number of drones that have maps of their own."""
        return len(self.recording.frames[0].by_drone)

    def press(self, key: str) -> None:
        """React to a key by its name in pygame."""
        self.hint = ""
        if key in ("escape", "q") or (key == "return" and self.is_at_end):
            self.quits = True
        elif key in ("p", "tab"):
            self.view = "both" if self.view == "matrix" else "matrix"
        elif key == "m" and self._drones:
            following = 0 if self.viewer is None else self.viewer + 1
            self.viewer = None if following == self._drones else following
        elif key == "n" or (key == "r" and self.recording.is_flight):
            self.recording.is_stopped = True
            self._start(self.seed + (key == "n"))
        elif not self.recording.flies:
            self._scrub(key)
        elif key in FLIGHT_KEYS:
            frames = self.recording.frames
            self.hint = _refusal(frames[-1], FLIGHT_KEYS[key])
            if not self.hint:
                self._position = len(frames) - 1.0  # the last move is complete
                self.recording.fly(FLIGHT_KEYS[key])

    def _scrub(self, key: str) -> None:
        if key == "r" or (key == "space" and self.is_at_end):
            # After a flight, those who still press the search key should see the result.
            if not self.recording.is_flight:
                self._position = 0.0
                self._goal = math.inf
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
            self.speed = min(2 * self.speed, FASTEST)
        elif key in ("down", "-"):
            self.speed = max(self.speed / 2, SLOWEST)

    def advance(self, seconds: float) -> None:
        by_hand = self.recording.is_flight and not self.recording.end_was_seen
        goal = min(math.inf if by_hand else self._goal, len(self.recording.frames) - 1)
        if by_hand or self.is_paused:
            rate = STEP_RATE * max(1.0, goal - self._position)
        else:
            rate = self._fps * self.speed
        if self._position < goal:
            self._position = min(goal, self._position + seconds * rate)
        self.recording.show(math.floor(self._position))


def _refusal(frame: Frame, action: Action) -> str:
    """Why drone 0 may not take an action, which would end the episode; empty if it may."""
    (x, y), *others = frame.drones
    ahead = Grid.of(frame.grid_size).neighbours[y * frame.grid_size + x][action]
    if ahead == OFF_GRID:
        return "the grid ends here"
    for number, (x, y) in enumerate(others, 1):
        if y * frame.grid_size + x == ahead:
            return f"drone {number} is there"
    return ""
