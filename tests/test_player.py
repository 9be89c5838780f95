"""The player of searches: its keys, its time, and flying by hand; without a display."""

import threading
import time
from collections.abc import Callable, Iterator
from dataclasses import replace

import pytest
from helpers import make_frame

from DroneSwarmSearch import Action, Ending
from DroneSwarmSearch.core import Frame
from DroneSwarmSearch.rendering.player import Player, Recording

LAST = 10
"""The number of steps in the episodes of these tests."""

FPS = 5.0


def frame(step: int = 0, drones: tuple[tuple[int, int], ...] = ((2, 2), (0, 1))) -> Frame:
    """A frame of a search with 3 x 3 cells, which ends with step `LAST`."""
    ending = Ending.TIME_LIMIT if step == LAST else None
    return replace(make_frame(3, drones=drones, step=step, ending=ending), hide_persons=True)


class Whole(Recording):
    """A recording that is complete from the start."""

    def __init__(self) -> None:
        super().__init__(iter([frame()]), "calm, ")
        self.frames += [frame(step) for step in range(1, LAST + 1)]


def watching(begin: Callable[[int], Recording] = lambda seed: Whole()) -> Player:
    """A player of complete recordings, by default."""
    return Player(begin, seed=3, fps=FPS)


def step_of(player: Player) -> float:
    """The moment shown, in steps."""
    frame, _, progress = player.moment
    return frame.step + progress


def advance_for_long(player: Player) -> None:
    """Give the thread of a recording time, until the end is shown."""
    for _ in range(10_000):
        time.sleep(0.001)
        player.advance(1)
        if player.is_at_end:
            return


class TestWatching:
    @pytest.mark.parametrize(
        ("script", "step", "status"),
        [
            ("0.3", 1.5, "calm, seed 3"),
            ("10 10", LAST, "Enter closes the window"),
            ("0.3 space 10 space 0.2", 3, "speed 1\N{MULTIPLICATION SIGN}"),
            ("0.3 right 1 right right 1", 4, "paused"),
            ("0.6 left left left left left 1", 0, "paused"),
            ("end 1 space 0.2", 1, ""),
            ("end 1 r 0.2", 1, ""),
            ("end home 1", 0, "paused"),
            ("up 0.2", 2, "speed 2\N{MULTIPLICATION SIGN}"),
            ("- - - -", 0, "speed 0.25\N{MULTIPLICATION SIGN}"),
            ("+ + + + + +", 0, "speed 8\N{MULTIPLICATION SIGN}"),
        ],
    )
    def test_keys_and_time(self, script, step, status):
        """A script has names of keys, and seconds."""
        player = watching()
        recording = player.recording
        for word in script.split():
            if word[0].isdigit():
                player.advance(float(word))
            else:
                player.press(word)
        assert step_of(player) == pytest.approx(step)
        assert status in player.status
        assert not player.quits and player.view == "matrix"
        assert player.recording is recording

    def test_views_and_quitting(self):
        player = watching()
        views = []
        for key in ("p", "tab", "return"):
            player.press(key)
            views.append(player.view)
        assert views == ["both", "matrix", "matrix"]
        assert not player.quits, "Enter quits only at the end"
        player.press("end")
        player.press("return")
        assert player.quits


class TestRecording:
    def test_it_waits_for_a_slow_policy(self):
        go_on = threading.Event()

        def frames() -> Iterator[Frame]:
            yield frame()
            assert go_on.wait(10)
            yield frame(LAST)

        player = watching(lambda seed: Recording(frames()))
        player.advance(10)
        assert step_of(player) == 0
        assert "planning" in player.status
        go_on.set()
        advance_for_long(player)
        assert player.is_at_end

    def test_an_error_of_the_policy_reaches_the_player_after_the_steps_before_it(self):
        failed = threading.Event()

        def frames() -> Iterator[Frame]:
            yield frame()
            yield frame(1)
            yield frame(2)
            failed.set()
            raise ValueError("no plan")

        player = watching(lambda seed: Recording(frames()))
        assert failed.wait(10)
        time.sleep(0.01)
        player.advance(1 / FPS)
        assert step_of(player) == 1
        with pytest.raises(ValueError, match="no plan"):
            advance_for_long(player)
        assert step_of(player) == 2


class TestFlying:
    @pytest.fixture
    def actions(self):
        """The actions of drone 0 so far."""
        return []

    @pytest.fixture
    def player(self, actions):
        """A player of flights in which drone 0 goes where the keys send it."""

        def begin(seed: int) -> Recording:
            def fly(action: Action) -> Frame:
                actions.append(action)
                (x, y), other = flight.frames[-1].drones
                x += (action == Action.RIGHT) - (action == Action.LEFT)
                y += (action == Action.DOWN) - (action == Action.UP)
                return frame(len(flight.frames), ((x, y), other))

            flight = Recording(iter([frame()]), fly=fly)
            return flight

        return watching(begin)

    def test_a_move_that_would_end_the_search_is_refused(self, player, actions):
        player.press("right")
        assert (actions, player.hint) == ([], "the grid ends here")
        player.press("left")
        assert player.hint == ""
        player.press("up")
        player.press("left")
        assert player.hint == "drone 1 is there"
        assert player.recording.frames[-1].drones[0] == (1, 1)
        player.press("space")
        assert player.hint == ""

    def test_a_flight_can_be_watched_once_it_has_ended(self, player, actions):
        assert ("Space", "search") in player.keys
        for _ in range(LAST):
            player.press("space")
        assert player.moment[0].hide_persons
        player.advance(60)
        assert player.is_at_end and ("Left, Right", "step") in player.keys
        assert not player.moment[0].hide_persons
        player.press("left")
        assert step_of(player) == LAST - 1
        player.press("home")
        player.press("space")
        player.advance(0.2)
        assert step_of(player) == 1
        player.press("end")
        player.press("space")
        assert player.is_at_end, "whoever still searches sees the result"
        assert len(actions) == LAST
