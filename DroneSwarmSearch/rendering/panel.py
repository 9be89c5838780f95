"""The panel right of the map: step, results so far, drift, colours, legend and hypotheses."""

from __future__ import annotations

from itertools import pairwise
from typing import NamedTuple

import numpy as np

from DroneSwarmSearch.frame import Frame
from DroneSwarmSearch.rendering import sprites
from DroneSwarmSearch.rendering._pygame import pygame
from DroneSwarmSearch.rendering.labels import signed
from DroneSwarmSearch.rendering.palette import (
    FAINT,
    GREY,
    HIGH_FROM,
    INK,
    MIDDLE_FROM,
    N_SHADES,
    PALETTES,
    PROGRESS,
    PROGRESS_LIGHT,
    readable_on,
    shades,
)
from DroneSwarmSearch.rendering.sprites import text_line, write

__all__ = ["Panel"]

WIDTH, LEAST_HEIGHT = 232, 704

HEADING, SMALL, BODY, LARGE = 18, 19, 22, 42
"""Font sizes."""

PROGRESS_TOP, PROGRESS_HEIGHT = 54, 7
FOUND_TOP = 92
SUCCESS_TOP = 144
DRIFT_TOP = 160
SCALE_TOP = 272
SYMBOLS_TOP = 360
FOOT_TOP = 504
"""Distances from the upper edge in pixels; see also `Sections`."""

SUCCESS_HEIGHT, RETURN_HEIGHT = 36, 24
"""Of the probability of success, where it is below the persons found, and of the return."""

HYPOTHESES_HEAD = 44
HYPOTHESES_ROW = 22
HYPOTHESES_ROWS = 3
DRONES_LEAST = 49
"""The heading and one row of drones."""

RULE_ABOVE = 16
COMPASS = 62
SCALE_HEIGHT = 16
LABEL_GAP = 6
SYMBOL_ROW = 30
SYMBOL_LEAST, SYMBOL_MOST = 15, 24

FINDERS_NAMED = 4
"""Drones named as finders; of more, only the first ones."""

DRONE_COLUMNS = 5
DRONE_ROW = 27
DRONE_SYMBOL = 20

WEIGHTS_HEIGHT = 17
WEIGHTS_ROOM = 62, 22
"""Of several persons, the room for the name and for the number of hypotheses."""
WEIGHT_GAP_FROM = 4
"""Parts of a bar at least this wide have a gap between them."""


class Sections(NamedTuple):
    """The sections of the panel that depend on the search, the same for all its frames.

    Attributes:
        persons: whether there are persons to find.
        success: whether the probability of success is known.
        returns: whether the return is known.
        rows: lines with hypotheses.
    """

    persons: bool
    success: bool
    returns: bool
    rows: int

    @property
    def success_below(self) -> bool:
        """Whether the probability of success is below the persons found."""
        return self.persons and self.success

    @property
    def return_top(self) -> int:
        return SUCCESS_TOP + (SUCCESS_HEIGHT if self.success_below else 0)

    @property
    def shift(self) -> int:
        """How far the sections below the results move down."""
        return self.return_top - SUCCESS_TOP + (RETURN_HEIGHT if self.returns else 0)

    @property
    def hypotheses_top(self) -> int:
        return FOOT_TOP + self.shift

    @property
    def drones_top(self) -> int:
        height = HYPOTHESES_HEAD + HYPOTHESES_ROW * self.rows if self.rows else 0
        return self.hypotheses_top + height


class Panel:
    """Draws the panel on surfaces of its `size`.

    Args:
        symbol: side of a drone on the map in pixels; the legend shows it at this size.
        gradient: whether cells are coloured smoothly.
        palette: a name in `PALETTES`.
        least_height: in pixels.

    Attributes:
        size: width and height in pixels.
    """

    def __init__(self, *, symbol: int, gradient: bool, palette: str, least_height: int) -> None:
        self.size = WIDTH, max(least_height, LEAST_HEIGHT)
        self._symbol = min(max(symbol, SYMBOL_LEAST), SYMBOL_MOST)
        self._gradient = gradient
        self._palette = PALETTES[palette]

    def _sections(self, frame: Frame) -> Sections:
        success, returns = frame.probability_of_success, frame.total_return
        sections = Sections(bool(frame.persons), success is not None, returns is not None, 0)
        room = self.size[1] - sections.hypotheses_top - HYPOTHESES_HEAD - DRONES_LEAST
        most = min(HYPOTHESES_ROWS, room // HYPOTHESES_ROW)
        return sections._replace(rows=min(len(frame.uncertain_persons), most))

    def draw(self, canvas: pygame.Surface, frame: Frame) -> None:
        """Draw the headings, and the values of a frame."""
        sections = self._sections(frame)
        self._draw_fixed(canvas, sections)
        self._draw_step(canvas, frame)
        if sections.persons:
            self._draw_found(canvas, frame)
        if frame.probability_of_success is not None:
            self._draw_success(canvas, frame.probability_of_success, below=sections.persons)
        if frame.total_return is not None:
            text = _return(frame.total_return)
            write(canvas, text, BODY, INK, topright=(WIDTH, sections.return_top - 2))
        self._draw_drift(canvas, frame.vector, DRIFT_TOP + sections.shift)
        self._draw_limits(canvas, float(frame.matrix.max()), SCALE_TOP + sections.shift)
        if sections.rows:
            self._draw_hypotheses(canvas, frame, sections)
        self._draw_drones(canvas, len(frame.drones), sections.drones_top)

    def _draw_fixed(self, canvas: pygame.Surface, sections: Sections) -> None:
        """Draw headings, colour scale and symbols, which are the same for every frame."""
        write(canvas, "STEP", HEADING, GREY, topleft=(0, 0))
        shift = sections.shift
        headings = [
            ("PERSONS FOUND" if sections.persons else "PROBABILITY OF SUCCESS", FOUND_TOP),
            ("DRIFT, CELLS PER STEP", DRIFT_TOP + shift),
            ("PROBABILITY OF A CELL, %", SCALE_TOP + shift),
            ("SYMBOLS", SYMBOLS_TOP + shift),
            ("DRONES", sections.drones_top),
        ]
        if sections.rows:
            headings.append(("HYPOTHESES", sections.hypotheses_top))
        for heading, top in headings:
            pygame.draw.line(canvas, FAINT, (0, top - RULE_ABOVE), (WIDTH - 1, top - RULE_ABOVE))
            write(canvas, heading, HEADING, GREY, topleft=(0, top))
        if sections.success_below:
            write(canvas, "PROBABILITY OF SUCCESS", HEADING, GREY, topleft=(0, SUCCESS_TOP))
        if sections.returns:
            write(canvas, "RETURN", HEADING, GREY, topleft=(0, sections.return_top))
        shares = np.linspace(0.0, 1.0, N_SHADES, dtype=np.float32)
        colours = self._palette.ramp[shades(shares, self._gradient)]
        bar = pygame.image.frombuffer(colours.tobytes(), (N_SHADES, 1), "RGB")
        place = pygame.Rect(0, SCALE_TOP + shift + 22, WIDTH, SCALE_HEIGHT)
        canvas.blit(pygame.transform.scale(bar, place.size), place)
        pygame.draw.rect(canvas, INK, place, width=1)
        self._draw_symbols(canvas, sections)

    def _draw_symbols(self, canvas: pygame.Surface, sections: Sections) -> None:
        side, colour, half = self._symbol, self._palette.drone(0), WIDTH // 2
        drone, small = sprites.drone(side, colour), sprites.drone(side - 4, colour)
        images = {
            "drone": (drone,),
            "searching": (sprites.search_ring(SYMBOL_MOST + 4), small),
            "collision": (sprites.collision(SYMBOL_MOST + 6), small),
            "person": (sprites.person(side),),
            "found": (sprites.found(side, colour),),
        }
        symbols = [(0, 0, "drone", "drone"), (half, 0, "searching", "searching")]
        if sections.persons:
            symbols += [
                (0, 1, "person", "person"),
                (half, 1, "collision", "collision"),
                (0, 2, "found", "found, in the drone's colour"),
            ]
        else:
            symbols.append((0, 1, "collision", "collision"))
        for left, row, name, meaning in symbols:
            middle = SYMBOLS_TOP + sections.shift + 36 + row * SYMBOL_ROW
            for image in images[name]:
                canvas.blit(image, image.get_rect(center=(left + SYMBOL_MOST // 2 + 2, middle)))
            write(canvas, meaning, SMALL, INK, midleft=(left + SYMBOL_MOST + 14, middle))

    def _draw_step(self, canvas: pygame.Surface, frame: Frame) -> None:
        _write_ratio(canvas, frame.step, frame.timestep_limit, 18, LARGE)
        _draw_progress(canvas, min(1.0, frame.step / frame.timestep_limit), PROGRESS_TOP)

    def _draw_found(self, canvas: pygame.Surface, frame: Frame) -> None:
        _write_ratio(canvas, sum(frame.found), len(frame.persons), FOUND_TOP + 18, LARGE - 8)
        finders = sorted({drone for drone in frame.found_by if drone is not None})
        if finders:
            names = ", ".join(map(str, finders[:FINDERS_NAMED]))
            more = ", ..." if len(finders) > FINDERS_NAMED else ""
            noun = "drones" if len(finders) > 1 else "drone"
            text = f"by {noun} {names}{more}"
            write(canvas, text, SMALL, INK, topright=(WIDTH, FOUND_TOP + 25))

    def _draw_success(self, canvas: pygame.Surface, probability: float, *, below: bool) -> None:
        """The probability of success: below the persons found, or in their place."""
        text = f"{probability:.1%}"
        if below:
            write(canvas, text, BODY, INK, topright=(WIDTH, SUCCESS_TOP - 2))
            _draw_progress(canvas, probability, SUCCESS_TOP + 18)
        else:
            write(canvas, text, LARGE - 8, INK, topleft=(0, FOUND_TOP + 18))

    def _draw_drift(self, canvas: pygame.Surface, vector: tuple[float, float], top: int) -> None:
        top += 22
        canvas.blit(sprites.compass(COMPASS, vector), (0, top))
        left = COMPASS + 22
        for name, value, middle in (
            ("x", vector[0], top + COMPASS // 2 - 13),
            ("y", vector[1], top + COMPASS // 2 + 13),
        ):
            write(canvas, name, BODY, GREY, midleft=(left, middle))
            write(
                canvas,
                signed(value).replace("-", "\N{MINUS SIGN}"),
                BODY + 4,
                INK,
                midleft=(left + 22, middle),
            )

    def _draw_limits(self, canvas: pygame.Surface, maximum: float, top: int) -> None:
        """The probabilities at the limits of the colour scale."""
        limits = (0.0, 0.5, 1.0) if self._gradient else (0.0, MIDDLE_FROM, HIGH_FROM, 1.0)
        foot = top + 22 + SCALE_HEIGHT
        room = WIDTH
        for share in reversed(limits):
            at = min(round(share * WIDTH), WIDTH - 1)
            pygame.draw.line(canvas, INK, (at, foot), (at, foot + 3))
            label = text_line(_percentage(share * maximum), SMALL, INK)
            width = label.get_width()
            left = max(0, min(at - width // 2, room - width))
            canvas.blit(label, (left, foot + 7))
            room = left - LABEL_GAP

    def _draw_hypotheses(self, canvas: pygame.Surface, frame: Frame, sections: Sections) -> None:
        """The probabilities of the hypotheses about the persons, as many persons as fit."""
        top = sections.hypotheses_top
        if len(frame.hypotheses) == 1:
            (weights,) = frame.hypotheses
            write(canvas, f"{len(weights)}", HEADING, GREY, topright=(WIDTH, top))
            _draw_weights(canvas, weights, pygame.Rect(0, top + 20, WIDTH, WEIGHTS_HEIGHT))
            return
        persons = frame.shown_uncertain_persons
        if len(persons) > sections.rows:
            text = f"and {len(persons) - sections.rows} more"
            write(canvas, text, HEADING, GREY, topright=(WIDTH, top))
        before, behind = WEIGHTS_ROOM
        bar = pygame.Rect(before, top + 20, WIDTH - before - behind, WEIGHTS_HEIGHT)
        for person in persons[: sections.rows]:
            weights = frame.hypotheses[person]
            write(canvas, f"person {person}", SMALL, INK, midleft=(0, bar.centery))
            write(canvas, f"{len(weights)}", SMALL, GREY, midright=(WIDTH, bar.centery))
            _draw_weights(canvas, weights, bar)
            bar.move_ip(0, HYPOTHESES_ROW)

    def _draw_drones(self, canvas: pygame.Surface, drones: int, top: int) -> None:
        """The drones' colours and numbers, as many as fit."""
        write(canvas, f"{drones}", HEADING, GREY, topright=(WIDTH, top))
        rows = (self.size[1] - top - 22) // DRONE_ROW
        shown = drones if drones <= rows * DRONE_COLUMNS else (rows - 1) * DRONE_COLUMNS
        for number in range(shown):
            row, column = divmod(number, DRONE_COLUMNS)
            middle = top + 34 + row * DRONE_ROW
            left = column * WIDTH // DRONE_COLUMNS
            image = sprites.drone(min(self._symbol, DRONE_SYMBOL), self._palette.drone(number))
            canvas.blit(image, image.get_rect(center=(left + DRONE_SYMBOL // 2, middle)))
            write(canvas, f"{number}", SMALL, INK, midleft=(left + DRONE_SYMBOL + 4, middle))
        if shown < drones:
            middle = top + 34 + (rows - 1) * DRONE_ROW
            write(canvas, f"and {drones - shown} more", SMALL, GREY, midleft=(0, middle))


def _draw_progress(canvas: pygame.Surface, share: float, top: int) -> None:
    """A thin bar of which a share is filled."""
    bar = pygame.Rect(0, top, WIDTH, PROGRESS_HEIGHT)
    pygame.draw.rect(canvas, FAINT, bar, border_radius=PROGRESS_HEIGHT // 2)
    bar.width = round(WIDTH * share)
    if bar.width:
        pygame.draw.rect(canvas, PROGRESS, bar, border_radius=PROGRESS_HEIGHT // 2)


def _draw_weights(canvas: pygame.Surface, weights: tuple[float, ...], bar: pygame.Rect) -> None:
    """A bar with a part for each probability, in percent where there is room."""
    edges = np.rint(bar.left + bar.width * np.cumsum((0.0, *weights))).astype(int).tolist()
    for number, (left, right) in enumerate(pairwise(edges)):
        colour = (PROGRESS, PROGRESS_LIGHT)[number % 2]
        part = pygame.Rect(left, bar.top, right - left, bar.height)
        if number and part.width >= WEIGHT_GAP_FROM:
            part = pygame.Rect(left + 1, bar.top, part.width - 1, bar.height)
        canvas.fill(colour, part)
        label = text_line(f"{weights[number]:.0%}", SMALL, readable_on(colour))
        if label.get_width() + LABEL_GAP <= part.width:
            canvas.blit(label, label.get_rect(center=part.center))


def _return(value: float) -> str:
    """A return with a typographic minus sign and separated thousands."""
    digits = 3 if abs(value) < 10 else 0
    return f"{value:,.{digits}f}".replace("-", "\N{MINUS SIGN}")


def _percentage(probability: float) -> str:
    """A probability in percent, in at most six characters."""
    value = 100 * probability
    if value == 0.0 or value >= 0.01:
        return f"{value:.3g}"
    digits, exponent = f"{value:.1e}".split("e")
    return f"{digits}e{int(exponent)}"


def _write_ratio(canvas: pygame.Surface, part: int, whole: int, top: int, size: int) -> None:
    """A large number, and on the same base line a small "of" with the total."""
    figure = write(canvas, f"{part}", size, INK, topleft=(0, top))
    # The base line of this font is at 0.8 of the line's height.
    base = top + 0.8 * figure.height
    rest = text_line(f"of {whole}", BODY, GREY)
    canvas.blit(rest, (figure.right + 7, round(base - 0.8 * rest.get_height())))
