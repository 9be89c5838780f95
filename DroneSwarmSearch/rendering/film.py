"""A compact picture of a search for a page or a paper: one map, cropped to what happens."""

from __future__ import annotations

import textwrap
from collections.abc import Sequence
from dataclasses import replace

import numpy as np
import pygame
from numpy.typing import NDArray

from DroneSwarmSearch.core.frame import Frame
from DroneSwarmSearch.rendering import palette, sprites
from DroneSwarmSearch.rendering.painter import draw_outcome, to_array
from DroneSwarmSearch.rendering.palette import GREY, INK, Look
from DroneSwarmSearch.rendering.search_map import LEFT, TOP, SearchMap
from DroneSwarmSearch.rendering.sprites import write

FONT, LETTER, LINE = 22, 8.2, 24  # of the text, about the width of a letter, the height of a line
PAD, ROW, SYMBOL = 10, 30, 22  # the margin, the height of a row below the map, of its symbols
SHOWN_FROM = 0.05  # the share of a map's maximum from which a cell is never cropped away


class Film:
    """Draws the frames of an episode, which it needs beforehand, to crop the map.

    Above the map is a `title`, cut to its first sentence if it is longer than two lines; below are
    the time, the policy, the probability of success and the symbols. Pictures are about `width`
    pixels wide.
    """

    def __init__(
        self, frames: Sequence[Frame], look: Look | None = None, *, title: str, width: int = 480
    ) -> None:
        self._look = look or Look()
        likely = [palette.shares_of_maximum(frame.matrix) > SHOWN_FROM for frame in frames]
        occupied = [cell for frame in frames for cell in frame.drones + frame.persons]
        cells = np.vstack([np.argwhere(np.any(likely, axis=0))[:, ::-1], *occupied])
        low, high, most = cells.min(axis=0), cells.max(axis=0), frames[0].grid_size
        size = min(int((high - low).max()) + 3, most)
        self._left, self._top = np.clip((low + high - size + 1) // 2, 0, most - size).tolist()
        self._map = SearchMap(size, self._look, side=width - 2 * PAD)
        letters = int(self._map.side / LETTER)
        if len(title) > 2 * letters:
            title = title.removesuffix(".").partition(". ")[0] + "."
        self._title = textwrap.wrap(title, letters, max_lines=2, placeholder=" …")
        self._head = LINE * len(self._title) + 2 * PAD

    def pixels(
        self, frame: Frame, *, towards: Frame | None = None, progress: float = 0.0
    ) -> NDArray[np.uint8]:
        """The picture of a frame, or of the way `towards` the next one at `progress`, 0 to 1."""
        side, top = self._map.side, self._head
        canvas = pygame.Surface((side + 2 * PAD, top + side + 3 * ROW + PAD), 0, 32)
        canvas.fill(palette.PAPER)
        if frame.ending is not None:
            draw_outcome(canvas, frame, pygame.Rect(PAD, PAD // 2, side, top - PAD))
        else:
            for number, text in enumerate(self._title):
                write(canvas, text, FONT, INK, topleft=(PAD, PAD + LINE * number))
        sea = pygame.Surface(self._map.size, 0, 32)
        self._map.draw(sea, self._cropped(frame), self._cropped(towards or frame), progress)
        canvas.blit(sea, (PAD, top), (LEFT, TOP, side, side))
        pygame.draw.rect(canvas, INK, (PAD - 1, top - 1, side + 2, side + 2), width=1)
        rows = [pygame.Rect(PAD, top + side + ROW * row + 2, side, ROW - 4) for row in range(3)]
        unit, so_far, limit = frame.progress
        time = write(canvas, f"{unit} {so_far} of {limit}", FONT, INK, midleft=rows[0].midleft)
        policy = sprites.fitted_line(frame.policy, FONT, side - time.width - 2 * PAD, GREY)
        canvas.blit(policy, policy.get_rect(midright=rows[0].midright))
        if (share := frame.probability_of_success) is not None:
            (left, top), inside = rows[1].topleft, rows[1].inflate(-PAD, 0)
            canvas.fill(palette.FAINT, rows[1])
            canvas.fill(palette.PROGRESS_LIGHT, (left, top, round(side * share), ROW - 4))
            write(canvas, "probability of success", FONT, INK, midleft=inside.midleft)
            write(canvas, f"{share:.0%}", FONT, INK, midright=inside.midright)
        self._draw_symbols(canvas, bool(frame.persons), rows[2])
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

    def _draw_symbols(self, canvas: pygame.Surface, persons: bool, row: pygame.Rect) -> None:
        ramp = pygame.image.frombuffer(self._look.ramp.tobytes(), (len(self._look.ramp), 1), "RGB")
        symbols = {
            "drone": sprites.drone(SYMBOL, 0),
            **({"person": sprites.person(SYMBOL)} if persons else {}),
            "searched": sprites.searched(SYMBOL // 2, 255),
            "likely": pygame.transform.scale(ramp, (2 * SYMBOL, SYMBOL // 2)),
        }
        left = row.left
        for meaning, image in symbols.items():
            at = canvas.blit(image, image.get_rect(midleft=(left, row.centery)))
            text = write(canvas, meaning, FONT, GREY, midleft=(at.right + PAD // 2, row.centery))
            left = text.right + 3 * PAD // 2
