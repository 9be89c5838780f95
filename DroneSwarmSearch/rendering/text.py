"""A frame as plain ASCII text, for terminals and for traces in tests."""

from __future__ import annotations

import numpy as np

from DroneSwarmSearch.rendering.frame import Frame
from DroneSwarmSearch.rendering.labels import percent, signed, tick_stride
from DroneSwarmSearch.rendering.palette import scaled

__all__ = ["RAMP", "render_text"]

RAMP = ".:;=oO%#@"
"""Probability from none (first) to the matrix maximum (last). Shares no character with
the marks below, so that whatever stands in a cell can be told from its probability."""

SEARCHES = "*"
TOGETHER = "+"
MISSING = "P"
FOUND = "F"

SPACED_UP_TO = 160
"""Characters in a line, at most, where nothing is known of the terminal."""


def render_text(frame: Frame, columns: int = SPACED_UP_TO) -> str:
    """The frame as lines of ASCII without escape codes, and no newline at the end.

    Every cell ends with the character of its probability; before it stands what is in
    the cell: drones by their numbers, `*` after one that searches, `+` between drones
    in the same cell, `P` for a missing and `F` for a found person (with a count if
    there are several). `12*P@` is drone 12 searching the likeliest cell, over a person.
    Cells are set apart by a space where the rows of the grid then fit some columns.
    """
    tokens = _tokens(frame)
    # A place for the searching mark is kept free: the width stays the same from frame to
    # frame unless several things meet in a cell.
    usual = len(str(len(frame.drones) - 1)) + len(SEARCHES)
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
    """Clock, drift and score, and how the episode ended if it did."""
    x, y = frame.vector
    status = (
        f"step {frame.step}/{frame.timestep_limit}"
        f" | drift x {signed(x)}, y {signed(y)} cells/step"
        f" | persons found {sum(frame.found)}/{len(frame.persons)}"
    )
    if frame.ending is None:
        return [status]
    return [status, f"{frame.outcome} ({frame.ending.description})"]


def _tokens(frame: Frame) -> dict[tuple[int, int], str]:
    """What stands in each cell that is not empty, by (x, y)."""
    drones: dict[tuple[int, int], list[str]] = {}
    for number, (cell, searches) in enumerate(zip(frame.drones, frame.searching, strict=True)):
        drones.setdefault(cell, []).append(f"{number}{SEARCHES if searches else ''}")
    tokens = {cell: TOGETHER.join(numbers) for cell, numbers in drones.items()}
    for mark, found in ((MISSING, False), (FOUND, True)):
        counts: dict[tuple[int, int], int] = {}
        for cell, is_found in zip(frame.persons, frame.found, strict=True):
            if is_found is found:
                counts[cell] = counts.get(cell, 0) + 1
        for cell, count in counts.items():
            tokens[cell] = tokens.get(cell, "") + mark + (str(count) if count > 1 else "")
    return tokens


def _column_numbers(grid_size: int, width: int) -> str:
    """The numbers of the columns, each ending where its cells end; thinned if too dense."""
    stride = tick_stride(len(str(grid_size - 1)) + 1, width)
    labelled = (str(x) if x % stride == 0 else "" for x in range(grid_size))
    line = ""
    for x, label in enumerate(labelled):
        line = line.ljust((x + 1) * width - len(label)) + label
    return line.rstrip()


def _rows(frame: Frame, tokens: dict[tuple[int, int], str], width: int, margin: int) -> list[str]:
    """One line per row of the grid: its number, then its cells."""
    levels = np.rint(scaled(frame.matrix) * (len(RAMP) - 1)).astype(np.intp)
    lines = []
    for y, row in enumerate(levels.tolist()):
        cells = ((tokens.get((x, y), "") + RAMP[level]).rjust(width) for x, level in enumerate(row))
        lines.append(f"{y:{margin - 1}} " + "".join(cells))
    return lines


def _legend(frame: Frame) -> str:
    """What the characters mean."""
    last = len(frame.drones) - 1
    numbers = "0" if last == 0 else f"0-{last}"
    return (
        f"{numbers} drone, {SEARCHES} searching, {TOGETHER} same cell"
        f" | person: {MISSING} missing, {FOUND} found"
        f" | {RAMP} probability, 0 to {percent(float(frame.matrix.max()))}"
    )
