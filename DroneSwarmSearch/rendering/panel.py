"""The panel right of the map: step, results so far, drift, colours, legend and hypotheses."""

from __future__ import annotations

from itertools import pairwise

import numpy as np
import pygame

from DroneSwarmSearch.frame import Frame
from DroneSwarmSearch.rendering import sprites
from DroneSwarmSearch.rendering.labels import drift
from DroneSwarmSearch.rendering.palette import (
    FAINT,
    GREY,
    HIGH_FROM,
    INK,
    MIDDLE_FROM,
    N_SHADES,
    PROGRESS,
    PROGRESS_LIGHT,
    Look,
    readable_on,
)
from DroneSwarmSearch.rendering.sprites import text_line, write

WIDTH, LEAST_HEIGHT = 232, 704
HEADING, SMALL, BODY, LARGE = 18, 19, 22, 42  # font sizes

# Of the sections; those below grow with their content.
RESULTS_TOP, RESULTS_HEIGHT, DRIFT_HEIGHT, SCALE_HEIGHT, SYMBOLS_HEIGHT = 92, 68, 112, 88, 144
HYPOTHESES_HEAD, HYPOTHESES_ROW, HYPOTHESES_ROWS = 44, 22, 3
DRONES_HEAD, DRONE_ROW, DRONE_COLUMNS, DRONE_SYMBOL = 22, 27, 5, 20
COMPASS = 62
SYMBOL_LEAST, SYMBOL_MOST = 15, 24
LABEL_GAP = 6
FINDERS_NAMED = 4  # of more drones that found somebody, only the first ones are named


def panel_size(least_height: int) -> tuple[int, int]:
    """The width and height of the panel in pixels."""
    return WIDTH, max(least_height, LEAST_HEIGHT)


def draw_panel(canvas: pygame.Surface, frame: Frame, look: Look, symbol: int) -> None:
    """Draw all sections on a surface of `panel_size`; `symbol` is the size of those on the map."""
    symbol = min(max(symbol, SYMBOL_LEAST), SYMBOL_MOST)
    unit, so_far, limit = frame.progress
    write(canvas, unit.upper(), HEADING, GREY, topleft=(0, 0))
    if frame.scale is not None:
        steps = f"STEP {frame.step} OF {frame.timestep_limit}"
        write(canvas, steps, HEADING, GREY, topright=(WIDTH, 0))
    _write_ratio(canvas, so_far, limit, 18, LARGE)
    _draw_progress(canvas, min(1.0, frame.step / frame.timestep_limit), 54)
    top = _draw_results(canvas, frame)
    _draw_drift(canvas, frame, top)
    top += DRIFT_HEIGHT
    _draw_scale(canvas, look, float(frame.matrix.max()), top)
    top += SCALE_HEIGHT
    _draw_symbols(canvas, look, symbol, bool(frame.persons), top)
    top += SYMBOLS_HEIGHT
    room = canvas.get_height() - top - HYPOTHESES_HEAD - DRONES_HEAD - DRONE_ROW
    rows = min(HYPOTHESES_ROWS, room // HYPOTHESES_ROW, len(frame.uncertain_persons))
    if rows:
        _draw_hypotheses(canvas, frame, rows, top)
        top += HYPOTHESES_HEAD + HYPOTHESES_ROW * rows
    _draw_drones(canvas, look, symbol, len(frame.drones), top)


def _draw_scale(canvas: pygame.Surface, look: Look, maximum: float, top: int) -> None:
    _heading(canvas, "PROBABILITY OF A CELL, %", top)
    colours = look.colours(np.linspace(0.0, 1.0, N_SHADES, dtype=np.float32))
    bar = pygame.image.frombuffer(colours.tobytes(), (N_SHADES, 1), "RGB")
    place = pygame.Rect(0, top + 22, WIDTH, 16)
    canvas.blit(pygame.transform.scale(bar, place.size), place)
    pygame.draw.rect(canvas, INK, place, width=1)
    limits = (0.0, 0.5, 1.0) if look.gradient else (0.0, MIDDLE_FROM, HIGH_FROM, 1.0)
    room = WIDTH
    for share in reversed(limits):
        at = min(round(share * WIDTH), WIDTH - 1)
        pygame.draw.line(canvas, INK, (at, place.bottom), (at, place.bottom + 3))
        label = text_line(_percentage(share * maximum), SMALL, INK)
        width = label.get_width()
        left = max(0, min(at - width // 2, room - width))
        canvas.blit(label, (left, place.bottom + 7))
        room = left - LABEL_GAP


def _draw_symbols(canvas: pygame.Surface, look: Look, side: int, persons: bool, top: int) -> None:
    _heading(canvas, "SYMBOLS", top)
    colour, half = look.drone(0), WIDTH // 2
    small = sprites.drone(side - 4, colour)
    symbols = [
        (0, 0, "drone", (sprites.drone(side, colour),)),
        (half, 0, "searching", (sprites.search_ring(SYMBOL_MOST + 4), small)),
        (half if persons else 0, 1, "collision", (sprites.collision(SYMBOL_MOST + 6), small)),
    ]
    if persons:
        found = (sprites.found(side, colour),)
        symbols.append((0, 1, "person", (sprites.person(side),)))
        symbols.append((0, 2, "found, in the drone's colour", found))
    for left, row, meaning, images in symbols:
        middle = top + 36 + row * 30
        for image in images:
            canvas.blit(image, image.get_rect(center=(left + SYMBOL_MOST // 2 + 2, middle)))
        write(canvas, meaning, SMALL, INK, midleft=(left + SYMBOL_MOST + 14, middle))


def _draw_drones(canvas: pygame.Surface, look: Look, side: int, drones: int, top: int) -> None:
    """The drones' colours and numbers, as many as fit."""
    _heading(canvas, "DRONES", top, f"{drones}")
    rows = (canvas.get_height() - top - DRONES_HEAD) // DRONE_ROW
    shown = drones if drones <= rows * DRONE_COLUMNS else (rows - 1) * DRONE_COLUMNS
    for number in range(shown):
        row, column = divmod(number, DRONE_COLUMNS)
        left, middle = column * WIDTH // DRONE_COLUMNS, top + 34 + row * DRONE_ROW
        image = sprites.drone(min(side, DRONE_SYMBOL), look.drone(number))
        canvas.blit(image, image.get_rect(center=(left + DRONE_SYMBOL // 2, middle)))
        write(canvas, f"{number}", SMALL, INK, midleft=(left + DRONE_SYMBOL + 4, middle))
    if shown < drones:
        middle = top + 34 + (rows - 1) * DRONE_ROW
        write(canvas, f"and {drones - shown} more", SMALL, GREY, midleft=(0, middle))


def _heading(canvas: pygame.Surface, text: str, top: int, right: str = "") -> None:
    pygame.draw.line(canvas, FAINT, (0, top - 16), (WIDTH - 1, top - 16))
    write(canvas, text, HEADING, GREY, topleft=(0, top))
    if right:
        write(canvas, right, HEADING, GREY, topright=(WIDTH, top))


def _draw_results(canvas: pygame.Surface, frame: Frame) -> int:
    """Persons found, probability of success and return; returns where the section ends."""
    success, top, bottom = frame.probability_of_success, RESULTS_TOP, RESULTS_TOP + RESULTS_HEIGHT
    if frame.persons:
        _heading(canvas, "PERSONS FOUND", top)
        _write_ratio(canvas, str(sum(frame.found)), str(len(frame.persons)), top + 18, LARGE - 8)
        finders = sorted({drone for drone in frame.found_by if drone is not None})
        if finders:
            names = ", ".join(map(str, finders[:FINDERS_NAMED]))
            more = ", ..." if len(finders) > FINDERS_NAMED else ""
            text = f"by drone{'s' * (len(finders) > 1)} {names}{more}"
            write(canvas, text, SMALL, INK, topright=(WIDTH, top + 25))
        if success is not None:
            _write_pair(canvas, "PROBABILITY OF SUCCESS", f"{success:.1%}", bottom - 16)
            _draw_progress(canvas, success, bottom + 2)
            bottom += 36
    else:
        _heading(canvas, "PROBABILITY OF SUCCESS", top)
        if success is not None:
            write(canvas, f"{success:.1%}", LARGE - 8, INK, topleft=(0, top + 18))
    if frame.total_return is not None:
        digits = 3 if abs(frame.total_return) < 10 else 0
        _write_pair(canvas, "RETURN", _minus(f"{frame.total_return:,.{digits}f}"), bottom - 16)
        bottom += 24
    return bottom


def _draw_drift(canvas: pygame.Surface, frame: Frame, top: int) -> None:
    unit, components = drift(frame)
    _heading(canvas, f"DRIFT, {unit if frame.scale else 'CELLS PER STEP'}", top)
    canvas.blit(sprites.compass(COMPASS, frame.vector), (0, top + 22))
    left, middle = COMPASS + 22, top + 22 + COMPASS // 2
    for (name, value), row in zip(components, (middle - 13, middle + 13), strict=True):
        write(canvas, name, BODY, GREY, midleft=(left, row))
        write(canvas, _minus(value), BODY + 4, INK, midleft=(left + 22, row))


def _draw_hypotheses(canvas: pygame.Surface, frame: Frame, rows: int, top: int) -> None:
    """The probabilities of the hypotheses about the persons, as many persons as fit."""
    bar = pygame.Rect(0, top + 20, WIDTH, 17)
    if len(frame.hypotheses) == 1:
        (weights,) = frame.hypotheses
        _heading(canvas, "HYPOTHESES", top, f"{len(weights)}")
        _draw_weights(canvas, weights, bar)
        return
    persons = frame.shown_uncertain_persons
    more = f"and {len(persons) - rows} more" if len(persons) > rows else ""
    _heading(canvas, "HYPOTHESES", top, more)
    bar.left, bar.width = 62, WIDTH - 84
    for person in persons[:rows]:
        weights = frame.hypotheses[person]
        write(canvas, f"person {person}", SMALL, INK, midleft=(0, bar.centery))
        write(canvas, f"{len(weights)}", SMALL, GREY, midright=(WIDTH, bar.centery))
        _draw_weights(canvas, weights, bar)
        bar.move_ip(0, HYPOTHESES_ROW)


def _draw_progress(canvas: pygame.Surface, share: float, top: int) -> None:
    for width, colour in ((WIDTH, FAINT), (round(WIDTH * share), PROGRESS)):
        if width:
            pygame.draw.rect(canvas, colour, (0, top, width, 7), border_radius=3)


def _draw_weights(canvas: pygame.Surface, weights: tuple[float, ...], bar: pygame.Rect) -> None:
    """A bar with a part for each probability, in percent where there is room."""
    edges = np.rint(bar.left + bar.width * np.cumsum((0.0, *weights))).astype(int).tolist()
    for number, (left, right) in enumerate(pairwise(edges)):
        colour = (PROGRESS, PROGRESS_LIGHT)[number % 2]
        gap = 1 if number and right - left >= 4 else 0
        part = pygame.Rect(left + gap, bar.top, right - left - gap, bar.height)
        canvas.fill(colour, part)
        label = text_line(f"{weights[number]:.0%}", SMALL, readable_on(colour))
        if label.get_width() + LABEL_GAP <= part.width:
            canvas.blit(label, label.get_rect(center=part.center))


def _minus(number: str) -> str:
    return number.replace("-", "\N{MINUS SIGN}")


def _percentage(probability: float) -> str:
    """A probability in percent, in at most six characters."""
    value = 100 * probability
    if value == 0.0 or value >= 0.01:
        return f"{value:.3g}"
    digits, exponent = f"{value:.1e}".split("e")
    return f"{digits}e{int(exponent)}"


def _write_pair(canvas: pygame.Surface, name: str, value: str, top: int) -> None:
    write(canvas, name, HEADING, GREY, topleft=(0, top))
    write(canvas, value, BODY, INK, topright=(WIDTH, top - 2))


def _write_ratio(canvas: pygame.Surface, part: str, whole: str, top: int, size: int) -> None:
    """A large number, and on the same base line a small "of" with the total."""
    figure = write(canvas, part, size, INK, topleft=(0, top))
    # The base line of this font is at 0.8 of the line's height.
    base = top + 0.8 * figure.height
    rest = text_line(f"of {whole}", BODY, GREY)
    canvas.blit(rest, (figure.right + 7, round(base - 0.8 * rest.get_height())))
