"""The player of searches: its keys, its time, and flying by hand; without a display."""

from __future__ import annotations

import threading
import time
from collections.abc import Callable, Iterator

import numpy as np
import pytest

from DroneSwarmSearch.frame import Frame
from DroneSwarmSearch.rendering.player import Player, Recording
from DroneSwarmSearch.rules import Action, Ending

LAST = 10
"""The number of steps in the episodes of these tests."""

FPS = 5.0


def frame(step: int = 0, drones: tuple[tuple[int, int], ...] = ((2, 2), (0, 1))) -> Frame:
    """A frame of a search with 3 x 3 cells, which ends with step `LAST`."""
    return Frame(
        matrix=np.full((3, 3), 1 / 9, np.float32),
        drones=drones,
        searching=(False,) * len(drones),
        persons=((1, 1),),
        found_by=(None,),
        step=step,
        timestep_limit=LAST,
        vector=(0.0, 0.0),
        ending=Ending.TIME_LIMIT if step == LAST else None,
        hide_persons=True,
    )


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
    moment = player.moment
    return moment.frame.step + moment.progress


def advance_for_long(player: Player) -> None:
    """Give the thread of a recording time, until the end is shown."""
    for _ in range(10_000):
        time.sleep(0.001)
        player.advance(1)
        if player.is_at_end:
            return


class TestWatching:
    def test_it_plays_to_the_end_and_stays_there(self) -> None:
        player = watching()
        assert step_of(player) == 0
        player.advance(0.3)
        moment = player.moment
        assert (moment.frame.step, moment.towards and moment.towards.step) == (1, 2)
        assert moment.progress == pytest.approx(0.5)
        assert not player.is_at_end
        for _ in range(3):
            player.advance(10)
        assert player.is_at_end
        assert step_of(player) == LAST
        assert "Enter closes the window" in player.status
        assert not player.quits

    def test_space_pauses_after_the_move_and_goes_on(self) -> None:
        player = watching()
        player.advance(0.3)
        player.press("space")
        player.advance(10)
        assert step_of(player) == 2
        assert "paused" in player.status
        player.press("space")
        player.advance(0.2)
        assert step_of(player) == 3
        assert "paused" not in player.status

    def test_arrows_step_forward_and_back(self) -> None:
        player = watching()
        player.advance(0.3)
        player.press("right")
        player.advance(1)
        assert step_of(player) == 2
        player.press("right")
        player.press("right")
        player.advance(1)
        assert step_of(player) == 4
        player.press("left")
        assert step_of(player) == 3
        for _ in range(5):
            player.press("left")
        player.advance(1)
        assert step_of(player) == 0

    @pytest.mark.parametrize("key", ["space", "r"])
    def test_it_plays_again_from_the_end(self, key: str) -> None:
        player = watching()
        player.press("end")
        player.advance(1)
        recording = player.recording
        player.press(key)
        player.advance(0.2)
        assert step_of(player) == 1
        assert player.recording is recording

    def test_speeds(self) -> None:
        player = watching()
        player.press("up")
        player.advance(0.2)
        assert step_of(player) == 2
        for key, speed in (("-", "0.25"), ("+", "8")):
            for _ in range(6):
                player.press(key)
            assert f"speed {speed}\N{MULTIPLICATION SIGN}" in player.status

    def test_the_next_seed(self) -> None:
        seeds = []

        def begin(seed: int) -> Recording:
            seeds.append(seed)
            return Whole()

        player = watching(begin)
        player.press("end")
        player.press("n")
        assert seeds == [3, 4]
        assert step_of(player) == 0
        assert "calm, seed 4" in player.status

    def test_the_prior(self) -> None:
        player = watching()
        views = [player.moment.view]
        for key in ("p", "tab"):
            player.press(key)
            views.append(player.moment.view)
        assert views == ["matrix", "both", "matrix"]

    def test_enter_quits_only_at_the_end(self) -> None:
        player = watching()
        player.press("return")
        assert not player.quits
        player.press("end")
        player.press("return")
        assert player.quits

    def test_keys_that_are_held_down_act_again_if_they_step(self) -> None:
        player = watching()
        for key in ("n", "p", "h", "r", "space"):
            player.press(key, repeated=True)
        assert (player.seed, player.view, player.shows_keys) == (3, "matrix", False)
        player.press("right")
        player.press("right", repeated=True)
        player.advance(1)
        assert step_of(player) == 2

    def test_hidden_persons_are_shown_once_the_end_was_seen(self) -> None:
        player = watching()
        player.advance(1)
        assert player.moment.frame.hide_persons
        player.press("end")
        player.advance(0)
        player.press("left")
        assert not player.moment.frame.hide_persons


class TestRecording:
    def test_it_waits_for_a_slow_policy(self) -> None:
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

    def test_a_step_that_the_policy_has_not_played_yet(self) -> None:
        go_on = threading.Event()

        def frames() -> Iterator[Frame]:
            yield frame()
            assert go_on.wait(10)
            for step in range(1, LAST + 1):
                yield frame(step)

        player = watching(lambda seed: Recording(frames()))
        player.press("right")
        player.press("right")
        go_on.set()
        for _ in range(200):
            time.sleep(0.001)
            player.advance(1)
        assert step_of(player) == 1
        assert player.is_paused

    def test_an_error_of_the_policy_reaches_the_player_after_the_steps_before_it(self) -> None:
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
    def actions(self) -> list[Action]:
        """The actions of drone 0 so far."""
        return []

    @pytest.fixture
    def player(self, actions: list[Action]) -> Player:
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

    def test_a_move_that_would_end_the_search_is_refused(
        self, player: Player, actions: list[Action]
    ) -> None:
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

    def test_a_flight_can_be_watched_once_it_has_ended(
        self, player: Player, actions: list[Action]
    ) -> None:
        for _ in range(LAST):
            player.press("space")
        assert player.moment.frame.hide_persons
        player.advance(60)
        assert player.is_at_end
        assert not player.moment.frame.hide_persons
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

    def test_the_keys_on_the_screen_follow_the_flight(self, player: Player) -> None:
        assert "search" in [each.meaning for each in player.keys]
        for _ in range(LAST):
            player.press("space")
        assert "step" in [each.meaning for each in player.keys]
