"""The panel beside or below the map: step, results, drift, colours, legend and hypotheses."""

from __future__ import annotations

from itertools import pairwise

import numpy as np
import pygame

from DroneSwarmSearch.core.frame import Frame
from DroneSwarmSearch.rendering import sprites
from DroneSwarmSearch.rendering.labels import drift, percent
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

WIDTH = 232
HEIGHT = 720
# font sizes
HEADING = 18
SMALL = 19
BODY = 22
LARGE = 42

# Of the sections; those below grow with their content.
RESULTS_TOP = 92
DRIFT_HEIGHT = 112
SCALE_HEIGHT = 88
SYMBOLS_HEIGHT = 144
HYPOTHESES_ROW = 22
HYPOTHESES_ROWS = 3
COMPASS = 62
SYMBOL = 24
NAME_WIDTH = 62  # left of a bar

FILM_GAP = 12  # between the two columns of a film
FILM_WIDTH = 2 * WIDTH + FILM_GAP
FILM_HEIGHT = 210


def draw_panel(canvas: pygame.Surface, frame: Frame, look: Look) -> None:
    """Draw all sections."""
    _draw_time(canvas, frame)
    top = _draw_results(canvas, frame)
    _draw_drift(canvas, frame, top)
    top += DRIFT_HEIGHT
    _draw_scale(canvas, look, float(frame.matrix.max()), top)
    top += SCALE_HEIGHT
    _draw_symbols(canvas, frame, top)
    top += SYMBOLS_HEIGHT
    persons = frame.uncertain_persons[:HYPOTHESES_ROWS]
    if persons and frame.shared_drift:
        _heading(canvas, "HYPOTHESES OF ALL PERSONS", top)
        area = pygame.Rect(0, top + 22, WIDTH, HYPOTHESES_ROWS * HYPOTHESES_ROW)
        _draw_columns(canvas, frame.hypotheses[persons[0]], area)
    elif persons:
        _heading(canvas, "HYPOTHESES", top)
        for row, person in enumerate(persons):
            bar = pygame.Rect(NAME_WIDTH, top + 20 + row * HYPOTHESES_ROW, WIDTH - NAME_WIDTH, 17)
            write(canvas, f"person {person}", SMALL, INK, midleft=(0, bar.centery))
            _draw_weights(canvas, frame.hypotheses[person], bar)


def draw_film_panel(canvas: pygame.Surface, frame: Frame) -> None:
    """Draw what changes at the left, and the symbols at the right."""
    height = canvas.get_height()
    left = canvas.subsurface((0, 0, WIDTH, height))
    right = canvas.subsurface((WIDTH + FILM_GAP, 0, WIDTH, height))
    _draw_time(left, frame)
    _draw_results(left, frame)
    _draw_symbols(right, frame, 0)


def _heading(canvas: pygame.Surface, text: str, top: int, right: str = "") -> None:
    pygame.draw.line(canvas, FAINT, (0, top - 16), (WIDTH - 1, top - 16))
    _write_pair(canvas, text, right, top)


def _write_pair(canvas: pygame.Surface, name: str, value: str, top: int) -> None:
    write(canvas, name, HEADING, GREY, topleft=(0, top))
    write(canvas, value, BODY, INK, topright=(WIDTH, top - 2))


def _draw_time(canvas: pygame.Surface, frame: Frame) -> None:
    unit, so_far, limit = frame.progress
    write(canvas, unit.upper(), HEADING, GREY, topleft=(0, 0))
    if frame.scale is not None:
        steps = f"STEP {frame.step} OF {frame.timestep_limit}"
        write(canvas, steps, HEADING, GREY, topright=(WIDTH, 0))
    figure = write(canvas, so_far, LARGE, INK, topleft=(0, 18))
    write(canvas, f"of {limit}", BODY, GREY, bottomleft=(figure.right + 7, figure.bottom - 4))
    _draw_progress(canvas, min(1.0, frame.step / frame.timestep_limit), 54)


def _draw_progress(canvas: pygame.Surface, share: float, top: int) -> None:
    for width, colour in ((WIDTH, FAINT), (round(WIDTH * share), PROGRESS)):
        if width:
            pygame.draw.rect(canvas, colour, (0, top, width, 7), border_radius=3)


def _draw_results(canvas: pygame.Surface, frame: Frame) -> int:
    """Persons found, probability of success and return; returns where the section ends."""
    top = RESULTS_TOP
    success = frame.probability_of_success
    total = frame.total_return
    _heading(canvas, "", top)
    if frame.persons:
        found = f"{sum(frame.found)} of {len(frame.persons)}"
        _write_pair(canvas, "PERSONS FOUND", found, top)
        top += 28
    if success is not None:
        _write_pair(canvas, "PROBABILITY OF SUCCESS", f"{success:.1%}", top)
        _draw_progress(canvas, success, top + 18)
        write(canvas, "of persons would be found by now", SMALL, GREY, topleft=(0, top + 31))
        top += 56
    if total is not None:
        digits = 3 if abs(total) < 10 else 0
        _write_pair(canvas, "RETURN", f"{total:,.{digits}f}", top)
        top += 28
    return top + 20


def _draw_drift(canvas: pygame.Surface, frame: Frame, top: int) -> None:
    unit, components = drift(frame)
    _heading(canvas, f"DRIFT, {unit if frame.scale else 'CELLS PER STEP'}", top)
    canvas.blit(sprites.compass(COMPASS, frame.vector), (0, top + 22))
    left = COMPASS + 22
    middle = top + 22 + COMPASS // 2
    for (name, value), row in zip(components, (middle - 13, middle + 13), strict=True):
        write(canvas, name, BODY, GREY, midleft=(left, row))
        write(canvas, value, BODY + 4, INK, midleft=(left + 22, row))


def _draw_scale(canvas: pygame.Surface, look: Look, maximum: float, top: int) -> None:
    _heading(canvas, "PROBABILITY OF A CELL", top)
    colours = look.colours(np.linspace(0.0, 1.0, N_SHADES, dtype=np.float32))
    bar = pygame.image.frombuffer(colours.tobytes(), (N_SHADES, 1), "RGB")
    area = pygame.Rect(0, top + 22, WIDTH, 16)
    canvas.blit(pygame.transform.scale(bar, area.size), area)
    pygame.draw.rect(canvas, INK, area, width=1)
    shares = (0.0, 0.5, 1.0) if look.gradient else (0.0, MIDDLE_FROM, HIGH_FROM, 1.0)
    for share in shares:
        label = text_line(percent(share * maximum), SMALL, INK)
        at = label.get_rect(midtop=(round(share * WIDTH), area.bottom + 7))
        canvas.blit(label, at.clamp(canvas.get_rect()))


def _draw_symbols(canvas: pygame.Surface, frame: Frame, top: int) -> None:
    _heading(canvas, "SYMBOLS", top)
    half = WIDTH // 2
    small = sprites.drone(SYMBOL - 4, 0)
    symbols = [
        (0, 0, "drone", (sprites.drone(SYMBOL, 0),)),
        (half, 0, "searching", (sprites.search_ring(SYMBOL + 4), small)),
        (half if frame.persons else 0, 1, "collision", (sprites.collision(SYMBOL + 6), small)),
    ]
    if frame.flown is not None:
        yours = sprites.halo(SYMBOL + 4), sprites.drone(SYMBOL - 8, frame.flown)
        symbols[0] = (0, 0, "you", yours)
    if frame.persons:
        found = (sprites.found(SYMBOL, 0),)
        symbols.append((0, 1, "person", (sprites.person(SYMBOL),)))
        symbols.append((0, 2, "found, in the drone's colour", found))
    for left, row, meaning, images in symbols:
        middle = top + 36 + row * 30
        for image in images:
            canvas.blit(image, image.get_rect(center=(left + SYMBOL // 2 + 2, middle)))
        write(canvas, meaning, SMALL, INK, midleft=(left + SYMBOL + 14, middle))


def _draw_columns(canvas: pygame.Surface, weights: tuple[float, ...], area: pygame.Rect) -> None:
    """A column for each probability, as high as it is relative to the largest one."""
    edges = np.rint(np.linspace(area.left, area.right, len(weights) + 1)).astype(int).tolist()
    most = max(weights)
    pygame.draw.line(canvas, GREY, area.bottomleft, area.bottomright)
    for number, (left, right) in enumerate(pairwise(edges)):
        height = round(area.height * weights[number] / most)
        gap = 1 if right - left > 3 else 0
        part = pygame.Rect(left, area.bottom - height, right - left - gap, height)
        canvas.fill(PROGRESS, part)
        colour = readable_on(PROGRESS)
        label = text_line(f"{weights[number]:.0%}", SMALL, colour)
        if label.get_width() < part.width and label.get_height() < part.height:
            canvas.blit(label, label.get_rect(midtop=part.midtop))


def _draw_weights(canvas: pygame.Surface, weights: tuple[float, ...], bar: pygame.Rect) -> None:
    """A bar with a part for each probability, in percent where there is room."""
    edges = np.rint(bar.left + bar.width * np.cumsum((0.0, *weights))).astype(int).tolist()
    for number, (left, right) in enumerate(pairwise(edges)):
        colour = (PROGRESS, PROGRESS_LIGHT)[number % 2]
        part = pygame.Rect(left, bar.top, right - left, bar.height)
        canvas.fill(colour, part)
        label = text_line(f"{weights[number]:.0%}", SMALL, readable_on(colour))
        if label.get_width() < part.width:
            canvas.blit(label, label.get_rect(center=part.center))
