"""A compact picture of a search for a page or a paper: one map, cropped to what happens."""

from __future__ import annotations

import textwrap
from collections.abc import Sequence
from dataclasses import replace

import numpy as np
import pygame
from numpy.typing import NDArray

from DroneSwarmSearch.frame import Frame
from DroneSwarmSearch.rendering import sprites
from DroneSwarmSearch.rendering.painter import draw_outcome, to_array
from DroneSwarmSearch.rendering.palette import (
    FAINT,
    GREY,
    INK,
    PAPER,
    PROGRESS_LIGHT,
    Look,
    shares_of_maximum,
)
from DroneSwarmSearch.rendering.search_map import LEFT, TOP, SearchMap
from DroneSwarmSearch.rendering.sprites import fitted_line, write

FONT, LETTER, LINE = 22, 8.2, 24  # of the text, about the width of a letter, the height of a line
PAD, ROW, SYMBOL = 10, 30, 22  # the margin, the height of a row below the map, of its symbols
TITLE_LINES = 2
SHOWN_FROM = 0.05  # the share of a map's maximum from which a cell is never cropped away


class Film:
    """Draws the frames of an episode, which it needs beforehand, to crop the map.

    Above the map is a `title` of up to two lines; below are the time, the policy, the probability
    of success and the symbols. Pictures are about `width` pixels wide.
    """

    def __init__(
        self, frames: Sequence[Frame], look: Look | None = None, *, title: str, width: int = 480
    ) -> None:
        self._look = look or Look()
        self._left, self._top, size = _crop(frames)
        self._map = SearchMap(size, self._look, side=width - 2 * PAD)
        self._width = self._map.side + 2 * PAD
        letters = int(self._map.side / LETTER)
        self._title = textwrap.wrap(title, letters, max_lines=TITLE_LINES, placeholder=" …")
        self._head = LINE * len(self._title) + 2 * PAD

    def pixels(
        self, frame: Frame, *, towards: Frame | None = None, progress: float = 0.0
    ) -> NDArray[np.uint8]:
        """The picture of a frame, or of the way `towards` the next one at `progress`, 0 to 1."""
        side = self._map.side
        canvas = pygame.Surface((self._width, self._head + side + 3 * ROW + PAD), 0, 32)
        canvas.fill(PAPER)
        self._draw_head(canvas, frame)
        sea = pygame.Surface(self._map.size, 0, 32)
        self._map.draw_inside(sea, self._cropped(frame), self._cropped(towards or frame), progress)
        canvas.blit(sea, (PAD, self._head), (LEFT, TOP, side, side))
        pygame.draw.rect(canvas, INK, (PAD - 1, self._head - 1, side + 2, side + 2), width=1)
        self._draw_rows(canvas, frame, self._head + side)
        return to_array(canvas)

    def _cropped(self, frame: Frame) -> Frame:
        x0, y0, size = self._left, self._top, self._map.grid_size
        return replace(
            frame,
            matrix=frame.matrix[y0 : y0 + size, x0 : x0 + size],
            drones=tuple((x - x0, y - y0) for x, y in frame.drones),
            persons=tuple((x - x0, y - y0) for x, y in frame.persons),
            trails=tuple(tuple((x - x0, y - y0) for x, y in trail) for trail in frame.trails),
            searched=tuple((x - x0, y - y0, age) for x, y, age in frame.searched),
        )

    def _draw_head(self, canvas: pygame.Surface, frame: Frame) -> None:
        if frame.ending is not None:
            area = pygame.Rect(PAD, PAD // 2, self._map.side, self._head - PAD)
            draw_outcome(canvas, frame, area)
            return
        for number, text in enumerate(self._title):
            write(canvas, text, FONT, INK, topleft=(PAD, PAD + LINE * number))

    def _draw_rows(self, canvas: pygame.Surface, frame: Frame, top: int) -> None:
        right, (unit, so_far, limit) = self._width - PAD, frame.progress
        middle = top + ROW // 2 + 2
        time = write(canvas, f"{unit} {so_far} of {limit}", FONT, INK, midleft=(PAD, middle))
        policy = fitted_line(frame.policy, FONT, right - time.right - 2 * PAD, GREY)
        canvas.blit(policy, policy.get_rect(midright=(right, middle)))
        if frame.probability_of_success is not None:
            bar = pygame.Rect(PAD, top + ROW, self._map.side, ROW - 4)
            pygame.draw.rect(canvas, FAINT, bar)
            done = round(bar.width * frame.probability_of_success)
            pygame.draw.rect(canvas, PROGRESS_LIGHT, (*bar.topleft, done, bar.height))
            at = bar.inflate(-PAD, 0)
            write(canvas, "probability of success", FONT, INK, midleft=at.midleft)
            text = f"{frame.probability_of_success:.0%}"
            write(canvas, text, FONT, INK, midright=at.midright)
        symbols = [("drone", sprites.drone(SYMBOL, 0)), ("searched", sprites.searched(12, 255))]
        if frame.persons:
            symbols.insert(1, ("person", sprites.person(SYMBOL)))
        left, middle = PAD, top + 2 * ROW + ROW // 2
        for meaning, image in symbols:
            canvas.blit(image, image.get_rect(midleft=(left, middle)))
            left = left + image.get_width() + PAD // 2
            left = write(canvas, meaning, FONT, GREY, midleft=(left, middle)).right + 2 * PAD
        ramp = pygame.image.frombuffer(self._look.ramp.tobytes(), (len(self._look.ramp), 1), "RGB")
        canvas.blit(pygame.transform.scale(ramp, (2 * SYMBOL, SYMBOL // 2)), (left, middle - 6))
        write(canvas, "likely", FONT, GREY, midleft=(left + 2 * SYMBOL + PAD // 2, middle))


def _crop(frames: Sequence[Frame]) -> tuple[int, int, int]:
    """The square around the likely cells, drones and persons of all frames: left, top, side."""
    likely = np.max([shares_of_maximum(frame.matrix) for frame in frames], axis=0) > SHOWN_FROM
    places = [place for frame in frames for place in frame.drones + frame.persons]
    cells = np.vstack([np.argwhere(likely)[:, ::-1], *places])
    low, high = cells.min(axis=0), cells.max(axis=0)
    size = frames[0].grid_size
    side = min(int((high - low).max()) + 3, size)
    left, top = np.clip((low + high - side + 1) // 2, 0, size - side).tolist()
    return left, top, side
