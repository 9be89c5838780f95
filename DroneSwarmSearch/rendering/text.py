"""A frame as plain ASCII text, for terminals and logs."""

from __future__ import annotations

from collections import Counter

import numpy as np

from DroneSwarmSearch.frame import Frame
from DroneSwarmSearch.rendering.labels import percent, signed, tick_stride
from DroneSwarmSearch.rendering.palette import shares_of_maximum

__all__ = ["RAMP", "render_text"]

RAMP = ".:;=oO%#@"
"""Probability from 0 (first) to the maximum of the matrix (last). Shares no character with
the marks below, so that a cell's probability stays readable behind the marks."""

SEARCHING = "*"
TOGETHER = "+"
MISSING = "P"
FOUND = "F"

WIDTH = 160
"""Characters in a line where the width of the terminal is unknown."""

WEIGHTS_NAMED, PERSONS_NAMED = 6, 4
"""Of more hypotheses, only the likeliest one is written; of more persons, only the first."""


def render_text(frame: Frame, columns: int = WIDTH) -> str:
    """The frame as lines of ASCII without escape codes, without a newline at the end.

    Every cell ends with the character of its probability. The contents of the cell come
    before it: drones by their numbers, `*` after a drone that searches, `+` between drones that
    share the cell, `P` for a missing person (with a count if there are several), `F1` for
    a person found there by drone 1. `12*P@` is drone 12 searching the likeliest cell, in
    which a person is.

    Args:
        frame: what to write.
        columns: characters in a line; a space separates the cells if they then fit.
    """
    tokens = _tokens(frame)
    # Room for the mark of a search is reserved: the width of a cell then changes from
    # frame to frame only where several things meet.
    usual = len(str(len(frame.drones) - 1)) + len(SEARCHING)
    width = max([usual, *map(len, tokens.values())]) + 1
    margin = len(str(frame.grid_size - 1)) + 1
    if margin + (width + 1) * frame.grid_size <= columns:
        width += 1
    return "\n".join(
        [
            *_header(frame),
            " " * margin + _column_numbers(frame.grid_size, width),
            *_rows(frame, tokens, width, margin),
            _legend(frame),
        ]
    )


def _header(frame: Frame) -> list[str]:
    """Step, drift and results so far; hypotheses; at the end of an episode, its outcome."""
    x, y = frame.vector
    status = [
        f"step {frame.step}/{frame.timestep_limit}",
        f"drift x {signed(x)}, y {signed(y)} cells/step",
    ]
    if frame.persons:
        status.append(f"persons found {sum(frame.found)}/{len(frame.persons)}")
    if frame.probability_of_success is not None:
        status.append(f"POS {frame.probability_of_success:.1%}")
    lines = [" | ".join(status)]
    if frame.uncertain_persons:
        lines.append(_hypotheses(frame))
    if frame.ending is not None:
        lines.append(f"{frame.outcome} ({frame.ending.description})")
    return lines


def _hypotheses(frame: Frame) -> str:
    """The probabilities of the hypotheses about each person of whom there are several."""
    if len(frame.hypotheses) == 1:
        return f"hypotheses: {_weights(frame.hypotheses[0])}"
    persons = frame.shown_uncertain_persons
    parts = [
        f"person {person} {_weights(frame.hypotheses[person])}"
        for person in persons[:PERSONS_NAMED]
    ]
    if len(persons) > PERSONS_NAMED:
        parts.append(f"{len(persons) - PERSONS_NAMED} more persons")
    return f"hypotheses: {' | '.join(parts) or 'none'}"


def _weights(weights: tuple[float, ...]) -> str:
    if len(weights) <= WEIGHTS_NAMED:
        return " ".join(f"{weight:.0%}" for weight in weights)
    return f"{len(weights)}, the likeliest {max(weights):.0%}"


def _tokens(frame: Frame) -> dict[tuple[int, int], str]:
    """The contents of each occupied cell, by (x, y)."""
    drones: dict[tuple[int, int], list[str]] = {}
    for number, (cell, searching) in enumerate(zip(frame.drones, frame.searching, strict=True)):
        drones.setdefault(cell, []).append(f"{number}{SEARCHING if searching else ''}")
    tokens = {cell: TOGETHER.join(numbers) for cell, numbers in drones.items()}
    finds = list(zip(frame.persons, frame.found_by, strict=True))
    missing = [cell for cell, drone in finds if drone is None and not frame.hide_persons]
    for cell, count in Counter(missing).items():
        tokens[cell] = tokens.get(cell, "") + MISSING + (str(count) if count > 1 else "")
    for cell, drone in finds:
        if drone is not None:
            tokens[cell] = f"{tokens.get(cell, '')}{FOUND}{drone}"
    return tokens


def _column_numbers(grid_size: int, width: int) -> str:
    """The numbers of the columns, right-aligned with their cells; thinned out if too dense."""
    stride = tick_stride(len(str(grid_size - 1)) + 1, width)
    line = ""
    for x in range(0, grid_size, stride):
        label = str(x)
        line = line.ljust((x + 1) * width - len(label)) + label
    return line


def _rows(frame: Frame, tokens: dict[tuple[int, int], str], width: int, margin: int) -> list[str]:
    """One line per row of the grid: its number, then its cells."""
    levels = np.rint(shares_of_maximum(frame.matrix) * (len(RAMP) - 1)).astype(np.intp)
    lines = []
    for y, row in enumerate(levels.tolist()):
        cells = ((tokens.get((x, y), "") + RAMP[level]).rjust(width) for x, level in enumerate(row))
        lines.append(f"{y:{margin - 1}} " + "".join(cells))
    return lines


def _legend(frame: Frame) -> str:
    """The meaning of the characters."""
    last = len(frame.drones) - 1
    numbers = "0" if last == 0 else f"0-{last}"
    meanings = [f"{numbers} drone, {SEARCHING} searching, {TOGETHER} same cell"]
    if frame.persons:
        meanings.append(f"person: {MISSING} missing, {FOUND}0 found by drone 0")
    meanings.append(f"{RAMP} probability, 0 to {percent(float(frame.matrix.max()))}")
    return " | ".join(meanings)
