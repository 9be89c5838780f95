"""Compact pictures of an episode."""

from dataclasses import replace
from typing import Any

import numpy as np
import pytest
from helpers import make_frame
from numpy.typing import NDArray

from DroneSwarmSearch.core.frame import Frame
from DroneSwarmSearch.core.rules import Ending
from DroneSwarmSearch.rendering.palette import FOUND, PAPER, PROGRESS_LIGHT, Look

pytest.importorskip("pygame")

from DroneSwarmSearch.rendering.film import Film


def episode(size: int = 40, **changes: Any) -> list[Frame]:
    """Two frames: a likely cell, a person and two drones in the middle of a large grid."""
    matrix = np.zeros((size, size), np.float32)
    matrix[22, 20] = 1.0
    places = {"drones": ((16, 20), (18, 20)), "persons": ((17, 23),), "matrix": matrix}
    frame = replace(make_frame(size, **places), probability_of_success=0.5, **changes)
    return [frame, replace(frame, drones=((17, 20), (18, 21)), step=4)]


def pixels(frames: list[Frame], title: str = "A raft drifts.", **changes: Any) -> NDArray[np.int64]:
    """The picture of the first frame, with some changes."""
    film = Film(frames, title=title)
    return film.pixels(replace(frames[0], **changes)).astype(np.int64)


def spread(one: NDArray[np.int64], other: NDArray[np.int64]) -> tuple[int, int]:
    """The height and width of what differs in two pictures."""
    rows, columns = (one != other).any(axis=2).nonzero()
    return int(np.ptp(rows)), int(np.ptp(columns))


def test_the_map_is_cropped_to_where_things_happen():
    near = pixels(episode())
    far = pixels([*episode(), replace(episode()[0], drones=((0, 0), (39, 39)))])
    assert near.shape[1] == pytest.approx(far.shape[1], abs=40)

    def blue(picture: NDArray[np.int64]) -> int:
        return int((picture == Look().ramp[-1]).all(axis=2).sum())

    assert blue(near) > 5 * blue(far) > 0


def test_the_outcome_replaces_the_title():
    frames = episode()
    before, after = pixels(frames), pixels(frames, ending=Ending.FOUND)
    assert (after[:60] == FOUND).all(axis=2).mean() > 0.3
    assert spread(before, after)[0] < 70
    assert before.shape == after.shape


def test_the_bar_is_as_long_as_the_probability_of_success():
    for share in (0.0, 0.25, 0.75, 1.0):
        picture = pixels(episode(), probability_of_success=share)
        filled = (picture == PROGRESS_LIGHT).all(axis=2).sum(axis=1).max()
        assert filled / picture.shape[1] == pytest.approx(share, abs=0.06)


def test_a_title_has_two_lines_at_most():
    first = "A life raft without ballast drifts for an hour in a wind of 34 knots."
    story = f"{first} {'Three aircraft search for it while it moves. ' * 4}"
    assert (pixels(episode(), story) == pixels(episode(), first)).all()
    none, one, two, long = (
        len(pixels(episode(), title)) for title in ("", "A raft.", first, "raft " * 60)
    )
    assert none < one < two == long
    right = pixels(episode(), "raft " * 60)[:, -8:]
    assert (right == PAPER).all()
