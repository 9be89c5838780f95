"""Frames as plain ASCII text, for terminals and logs."""

from __future__ import annotations

import math
import shutil
import sys
import textwrap
import time
from collections import Counter
from collections.abc import Iterable

import numpy as np

from DroneSwarmSearch._internal.arrays import Flags, Ints
from DroneSwarmSearch.core.frame import Frame
from DroneSwarmSearch.core.rules import Ending
from DroneSwarmSearch.rendering.labels import drift, percent, tick_stride
from DroneSwarmSearch.rendering.palette import shares_of_maximum

# From probability 0 to the matrix's maximum; differs from the marks, to be readable behind them.
RAMP = ".:;=oO%#@"
LAND = "/"  # in place of the probability 0
SEARCHING, SEVERAL, MISSING, FOUND = "*+PF"
WIDTH = 80  # characters in a line of a table, and where the width of the terminal is unknown

# Without a terminal: the most frames between the first and the last, and the steps between them.
PRINTED_FRAMES = 5
PRINTED_STRIDE = 10


def render_text(frame: Frame, columns: int = WIDTH, rows: int | None = None) -> str:
    """The frame as lines of ASCII without escape codes, without a newline at the end.

    A cell ends with the character of its probability. Before it come drones by number, `*` after
    one that searches, `+` between drones of a cell, `P` for a missing person (with a count of
    several), `F1` for one found there by drone 1. Cells keep their width during an episode: `+`
    stands for what does not fit, which is listed below the map. If the map is larger than
    `columns` and `rows`, a square of the map stands for several cells.
    """
    size = frame.grid_size
    margin = len(str(size - 1)) + 1
    # The other lines: status, numbers of columns, ending, cells in full, legend.
    high = size if rows is None else rows - 7 - len(frame.uncertain_persons)
    side = math.ceil(size / max(1, min(columns - margin, high)))  # of a square, in cells
    edges = np.arange(0, size, side)
    width = min((columns - margin) // len(edges), len(f"{len(frame.drones) - 1}{SEARCHING}") + 3)
    header = " " * margin
    for x in range(0, len(edges), tick_stride(margin, width)):
        header = header.ljust(margin + (x + 1) * width - len(str(edges[x]))) + str(edges[x])
    tokens = _tokens(frame, side)
    room = max(1, width - 1)

    def fit(token: str) -> str:
        shorter = token, FOUND + token.rpartition(FOUND)[2], token.rstrip(SEARCHING), SEVERAL
        return next(part for part in shorter if len(part) <= room)

    fitted = {square: fit(token) for square, token in tokens.items()}
    sums = np.add.reduceat(np.add.reduceat(frame.matrix, edges, axis=0), edges, axis=1)
    levels = np.rint(shares_of_maximum(sums) * (len(RAMP) - 1)).astype(np.intp)
    lines = [*_header(frame, columns), header]
    is_land = _is_land(frame, edges)
    for y, row in enumerate(levels.tolist()):
        marks = (
            LAND if level == 0 and on_land else RAMP[level]
            for level, on_land in zip(row, is_land[y].tolist(), strict=True)
        )
        texts = (fitted.get((x, y), "") + mark for x, mark in enumerate(marks))
        cells = (text[:width].rjust(width) for text in texts)
        lines.append(f"{side * y:{margin - 1}} " + "".join(cells))
    cut = tokens.items() - fitted.items()
    full = (f"({side * x}, {side * y}): {token}" for (x, y), token in sorted(cut))
    return "\n".join([*lines, *_joined(full, columns), *_legend(frame, columns, side, sums.max())])


def print_frames(frames: Iterable[Frame], fps: float) -> None:
    """Draw the frames of an episode in place on a terminal, at `fps`, as large as fits it.

    To any other output, print a selection of whole frames.
    """
    in_place = sys.stdout.isatty()
    height = 0
    for frame in frames:
        stride = max(PRINTED_STRIDE, math.ceil(frame.timestep_limit / PRINTED_FRAMES))
        if in_place:
            columns, rows = shutil.get_terminal_size()
            lines = render_text(frame, columns, rows - 1).split("\n")[: rows - 1]
            if height:
                print(f"\x1b[{height}A\x1b[J", end="")
            print("\n".join(lines), flush=True)
            height = len(lines)
            time.sleep(1 / fps)
        elif frame.ending is not None or frame.step % stride == 0:
            print(render_text(frame) + "\n", flush=True)
    if in_place:
        print()


def _header(frame: Frame, columns: int) -> list[str]:
    """Time, drift and results so far; hypotheses; at the end of an episode, its outcome."""
    time, so_far, limit = frame.progress
    unit, components = drift(frame)
    status = [f"{time} {so_far}/{limit}", f"drift {', '.join(map(' '.join, components))} {unit}"]
    if frame.persons:
        status.append(f"found {sum(frame.found)}/{len(frame.persons)}")
    if frame.probability_of_success is not None:
        status.append(f"POS {frame.probability_of_success:.1%}")
    if frame.viewer is not None:
        status.append(f"what drone {frame.viewer} knows")
    if frame.links is not None:
        heard = ", ".join(f"{first}-{second}" for first, second in frame.links)
        status.append(f"in range: {heard or 'nobody'}")
    lines = _joined(status, columns)
    for person in frame.uncertain_persons:
        weights = " ".join(f"{weight:.0%}" for weight in frame.hypotheses[person])
        whose = f" of person {person}" if len(frame.hypotheses) > 1 else ""
        if frame.shared_drift:
            whose = " of all persons"
        lines += _joined([f"hypotheses{whose}: {weights}"], columns)
    if frame.ending is not None:
        lines += _joined([f"{frame.outcome} ({frame.ending.description})"], columns)
        if frame.ending is Ending.FOUND and frame.probability_of_success is not None:
            success = f"{frame.probability_of_success:.1%}"
            lines.append(f"Found here; {success} of all persons would be found by now")
    return lines


def _joined(parts: Iterable[str], columns: int) -> list[str]:
    """Lines of the parts, with bars between them; a part that fits a line is not broken."""
    whole = " | ".join(part.replace(" ", "\xa0") for part in parts)
    lines = textwrap.wrap(whole, columns)
    return [line.replace("\xa0", " ").removesuffix(" |") for line in lines]


def _tokens(frame: Frame, side: int) -> dict[tuple[int, int], str]:
    """The text in each square of the map, which stands for `side` x `side` cells."""
    drones, persons = (
        [(x // side, y // side) for x, y in cells] for cells in (frame.drones, frame.persons)
    )
    tokens: dict[tuple[int, int], str] = {}
    for number, (square, searching) in enumerate(zip(drones, frame.searching, strict=True)):
        before = tokens[square] + SEVERAL if square in tokens else ""
        tokens[square] = f"{before}{number}{SEARCHING if searching else ''}"
    finds = list(zip(persons, frame.found_by, strict=True))
    missing = [square for square, drone in finds if drone is None and not frame.hide_persons]
    for square, count in Counter(missing).items():
        tokens[square] = tokens.get(square, "") + MISSING + (str(count) if count > 1 else "")
    for square, drone in finds:
        if drone is not None:
            tokens[square] = f"{tokens.get(square, '')}{FOUND}{drone}"
    return tokens


def _is_land(frame: Frame, edges: Ints) -> Flags:
    """Whether most of the cells in each square of the map are on land: bool, [row, column]."""
    cells = np.zeros((frame.grid_size, frame.grid_size))
    for x, y in frame.land:
        if min(x, y) >= 0 and max(x, y) < frame.grid_size:
            cells[y, x] = 1.0
    ones = np.ones_like(cells)
    counts, of = (
        np.add.reduceat(np.add.reduceat(values, edges, axis=0), edges, axis=1)
        for values in (cells, ones)
    )
    is_land: Flags = 2 * counts > of
    return is_land


def _legend(frame: Frame, columns: int, side: int, maximum: float) -> list[str]:
    last = len(frame.drones) - 1
    drones = "0" if last == 0 else f"0-{last}"
    meanings = [f"{drones} drone, {SEARCHING} searching, {SEVERAL} more, listed below"]
    if frame.persons:
        meanings.append(f"{MISSING} person, {FOUND}0 found by drone 0")
    if frame.land:
        meanings.append(f"{LAND} land")
    of = f" of {side} x {side} cells" if side > 1 else ""
    meanings.append(f"{RAMP} probability{of}, 0 to {percent(maximum)}")
    return _joined(meanings, columns)
