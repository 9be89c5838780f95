"""Films of an episode: small pictures, cropped to where something happens."""

from dataclasses import replace
from typing import Any

import numpy as np
import pytest
from helpers import make_frame
from numpy.typing import NDArray

from DroneSwarmSearch import Ending
from DroneSwarmSearch.core import Frame
from DroneSwarmSearch.rendering import Look, video
from DroneSwarmSearch.rendering.palette import FOUND, PAPER, PROGRESS

pytest.importorskip("pygame")


def episode(size: int = 40, **changes: Any) -> list[Frame]:
    """Two frames: a likely cell, a person and two drones in the middle of a large grid."""
    matrix = np.zeros((size, size), np.float32)
    matrix[22, 20] = 1.0
    places = {"drones": ((16, 20), (18, 20)), "persons": ((17, 23),), "matrix": matrix}
    frame = replace(make_frame(size, **places), probability_of_success=0.5, **changes)
    return [frame, replace(frame, drones=((17, 20), (18, 21)), step=4)]


@pytest.fixture
def pictures(monkeypatch, tmp_path):
    """A function that returns the pictures of a film of some frames."""
    written: list[NDArray[np.int64]] = []

    def keep(path: Any, shown: Any, **options: Any) -> None:
        written[:] = [picture.astype(np.int64) for picture in shown]

    monkeypatch.setattr(video, "write_pictures", keep)

    def film(frames: list[Frame], title: str = "A raft drifts.") -> list[NDArray[np.int64]]:
        video.write_video(tmp_path / "film.gif", frames, Look(), title=title, fps=25.0, hold=1.0)
        return [*written]

    return film


def spread(one: NDArray[np.int64], other: NDArray[np.int64]) -> tuple[int, int]:
    """The height and width of what differs in two pictures."""
    rows, columns = (one != other).any(axis=2).nonzero()
    return int(np.ptp(rows)), int(np.ptp(columns))


def test_the_map_is_cropped_to_where_things_happen(pictures):
    near = pictures(episode())[0]
    far = pictures([*episode(), replace(episode()[0], drones=((0, 0), (39, 39)))])[0]
    assert near.shape[1] == pytest.approx(far.shape[1], abs=40)

    def blue(picture: NDArray[np.int64]) -> int:
        return int((picture == Look().ramp[-1]).all(axis=2).sum())

    assert blue(near) > 5 * blue(far) > 0


def test_the_outcome_is_shown_above_the_map(pictures):
    going = episode()
    ended = [going[0], replace(going[1], ending=Ending.FOUND)]
    before = pictures(going)[-1]
    after = pictures(ended)[-1]
    assert (after[:52] == FOUND).all(axis=2).mean() > 0.3
    assert before.shape == after.shape
    assert spread(before[:52], after[:52])[0] < 52


def test_the_bar_is_as_long_as_the_probability_of_success(pictures):
    """It is the second bar below the map, after that of the steps."""
    for share in (0.25, 0.75, 1.0):
        picture = pictures([replace(episode()[0], step=0, probability_of_success=share)])[0]
        below = picture[picture.shape[0] * 2 // 3 :]
        filled = (below == PROGRESS).all(axis=2).sum(axis=1).max()
        assert filled / 232 == pytest.approx(share, abs=0.03)


def test_a_long_title_is_cut_to_its_first_sentence(pictures):
    first = "A life raft without ballast drifts for an hour in a wind of 34 knots."
    story = f"{first} {'Three aircraft search for it while it moves. ' * 4}"
    assert (pictures(episode(), story)[0] == pictures(episode(), first)[0]).all()
    none, one, two = (len(pictures(episode(), title)[0]) for title in ("", "A raft.", first))
    assert none < one < two
    right = pictures(episode(), "raft " * 60)[0][:, -8:]
    assert (right == PAPER).all()
