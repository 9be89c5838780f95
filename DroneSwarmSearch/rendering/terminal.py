"""Frames as text on standard output."""

from __future__ import annotations

import math
import shutil
import sys
import textwrap
import time
from collections.abc import Iterable

from DroneSwarmSearch.frame import Frame
from DroneSwarmSearch.rendering.text import render_text

__all__ = ["fitted", "show"]

PRINTED_FRAMES, PRINTED_STRIDE = 5, 10
"""Without a terminal, the most frames printed between the first and the last one, and the
fewest steps between them."""


def show(frames: Iterable[Frame], fps: float) -> None:
    """Draw frames in place on a terminal; print a selection to any other output.

    Args:
        frames: the frames of one episode, in order.
        fps: frames per second on a terminal.
    """
    if sys.stdout.isatty():
        _animate(frames, fps)
        return
    for frame in frames:
        stride = max(PRINTED_STRIDE, math.ceil(frame.timestep_limit / PRINTED_FRAMES))
        if frame.ending is not None or frame.step % stride == 0:
            print(render_text(frame) + "\n", flush=True)


def _animate(frames: Iterable[Frame], fps: float) -> None:
    height, due = 0, time.monotonic()
    try:
        for frame in frames:
            *lines, last = fitted(frame, *shutil.get_terminal_size())
            to_the_top = f"\r\x1b[{height}A" if height else "\r"
            # Each line is erased before it is written: erasing the rest of a full line
            # would remove its last character.
            sys.stdout.write(to_the_top)
            sys.stdout.writelines(f"\x1b[2K{line}\n" for line in lines)
            sys.stdout.write(f"\x1b[J{last}")
            sys.stdout.flush()
            height = len(lines)
            if frame.ending is None:
                due += 1 / fps
                time.sleep(max(0.0, due - time.monotonic()))
    finally:
        print("\n")


def fitted(frame: Frame, columns: int, rows: int) -> list[str]:
    """The frame as lines of text that fit a terminal.

    If the grid does not fit, the part around the likeliest cell is shown.
    """
    lines = render_text(frame, columns).split("\n")
    size = frame.grid_size
    header, grid, legend = lines[: -size - 2], lines[-size - 2 : -1], lines[-1]
    header = [part for line in header for part in textwrap.wrap(line, columns)]
    footer = textwrap.wrap(legend, columns)

    margin = len(str(size - 1)) + 1
    width = (len(grid[-1]) - margin) // size
    y, x = divmod(int(frame.matrix.argmax()), size)
    left, right = _visible(x, size, (columns - margin) // width)
    top, bottom = _visible(y, size, rows - len(header) - 1 - len(footer))
    grid = [
        line[:margin] + line[margin + left * width : margin + right * width]
        for line in (grid[0], *grid[1 + top : 1 + bottom])
    ]
    return [*header, *grid, *footer][:rows]


def _visible(centre: int, size: int, room: int) -> tuple[int, int]:
    """The range of `size` cells that fits the room, as near to the centre as possible."""
    room = min(max(1, room), size)
    first = min(max(0, centre - room // 2), size - room)
    return first, first + room
