"""Frames as plain ASCII text, for terminals and logs."""

from __future__ import annotations

import math
import shutil
import sys
import time
from collections import Counter
from collections.abc import Iterable

import numpy as np

from DroneSwarmSearch.frame import Frame
from DroneSwarmSearch.rendering.labels import drift, percent, tick_stride
from DroneSwarmSearch.rendering.palette import shares_of_maximum

# From probability 0 to the matrix's maximum; differs from the marks, to be readable behind them.
RAMP = ".:;=oO%#@"
SEARCHING, TOGETHER, MISSING, FOUND = "*+PF"
WIDTH = 160  # characters in a line where the width of the terminal is unknown

# Without a terminal: the most frames between the first and the last, and the steps between them.
PRINTED_FRAMES, PRINTED_STRIDE = 5, 10


def render_text(frame: Frame, columns: int = WIDTH) -> str:
    """The frame as lines of ASCII without escape codes, without a newline at the end.

    A cell ends with the character of its probability. Before it come drones by number, `*` after
    one that searches, `+` between drones of a cell, `P` for a missing person (with a count of
    several), `F1` for one found there by drone 1. Cells are separated by a space if they then fit
    `columns`.
    """
    size, tokens = frame.grid_size, _tokens(frame)
    # Room for the mark of a search is reserved: the width of a cell then changes from
    # frame to frame only where several things meet.
    usual = len(f"{len(frame.drones) - 1}{SEARCHING}")
    width = max([usual, *map(len, tokens.values())]) + 1
    margin = len(str(size - 1)) + 1
    if margin + (width + 1) * size <= columns:
        width += 1
    numbers = ""
    for x in range(0, size, tick_stride(margin, width)):
        numbers = numbers.ljust((x + 1) * width - len(str(x))) + str(x)
    lines = [*_header(frame), " " * margin + numbers]
    levels = np.rint(shares_of_maximum(frame.matrix) * (len(RAMP) - 1)).astype(np.intp)
    for y, row in enumerate(levels.tolist()):
        cells = ((tokens.get((x, y), "") + RAMP[level]).rjust(width) for x, level in enumerate(row))
        lines.append(f"{y:{margin - 1}} " + "".join(cells))
    return "\n".join([*lines, _legend(frame)])


def print_frames(frames: Iterable[Frame], fps: float) -> None:
    """Draw the frames of an episode in place on a terminal, at `fps`, cut off at its edges.

    To any other output, print a selection of whole frames.
    """
    in_place, height = sys.stdout.isatty(), 0
    for frame in frames:
        stride = max(PRINTED_STRIDE, math.ceil(frame.timestep_limit / PRINTED_FRAMES))
        if in_place:
            columns, rows = shutil.get_terminal_size()
            lines = render_text(frame, columns).split("\n")[: rows - 1]
            if height:
                print(f"\x1b[{height}A\x1b[J", end="")
            print("\n".join(line[:columns] for line in lines), flush=True)
            height = len(lines)
            time.sleep(1 / fps)
        elif frame.ending is not None or frame.step % stride == 0:
            print(render_text(frame) + "\n", flush=True)
    if in_place:
        print()


def _header(frame: Frame) -> list[str]:
    """Time, drift and results so far; hypotheses; at the end of an episode, its outcome."""
    (time, so_far, limit), (unit, components) = frame.progress, drift(frame)
    status = [f"{time} {so_far}/{limit}", f"drift {', '.join(map(' '.join, components))} {unit}"]
    if frame.persons:
        status.append(f"persons found {sum(frame.found)}/{len(frame.persons)}")
    if frame.probability_of_success is not None:
        status.append(f"POS {frame.probability_of_success:.1%}")
    lines = [" | ".join(status)]
    for person in frame.uncertain_persons:
        weights = " ".join(f"{weight:.0%}" for weight in frame.hypotheses[person])
        whose = f" of person {person}" if len(frame.hypotheses) > 1 else ""
        lines.append(f"hypotheses{whose}: {weights}")
    if frame.ending is not None:
        lines.append(f"{frame.outcome} ({frame.ending.description})")
    return lines


def _tokens(frame: Frame) -> dict[tuple[int, int], str]:
    tokens: dict[tuple[int, int], str] = {}
    for number, (cell, searching) in enumerate(zip(frame.drones, frame.searching, strict=True)):
        before = tokens[cell] + TOGETHER if cell in tokens else ""
        tokens[cell] = f"{before}{number}{SEARCHING if searching else ''}"
    finds = list(zip(frame.persons, frame.found_by, strict=True))
    missing = [cell for cell, drone in finds if drone is None and not frame.hide_persons]
    for cell, count in Counter(missing).items():
        tokens[cell] = tokens.get(cell, "") + MISSING + (str(count) if count > 1 else "")
    for cell, drone in finds:
        if drone is not None:
            tokens[cell] = f"{tokens.get(cell, '')}{FOUND}{drone}"
    return tokens


def _legend(frame: Frame) -> str:
    last = len(frame.drones) - 1
    numbers = "0" if last == 0 else f"0-{last}"
    meanings = [f"{numbers} drone, {SEARCHING} searching, {TOGETHER} same cell"]
    if frame.persons:
        meanings.append(f"person: {MISSING} missing, {FOUND}0 found by drone 0")
    meanings.append(f"{RAMP} probability, 0 to {percent(float(frame.matrix.max()))}")
    return " | ".join(meanings)
