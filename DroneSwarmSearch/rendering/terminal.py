"""Frames as text on standard output."""

from __future__ import annotations

import math
import shutil
import sys
import time
from collections.abc import Iterable

from DroneSwarmSearch.frame import Frame
from DroneSwarmSearch.rendering.text import render_text

__all__ = ["show"]

PRINTED_FRAMES, PRINTED_STRIDE = 5, 10
"""Without a terminal, the most frames printed between the first and the last one, and the
fewest steps between them."""


def show(frames: Iterable[Frame], fps: float) -> None:
    """Draw frames in place on a terminal, which cuts them off at its edges.

    To any other output, print a selection of whole frames.

    Args:
        frames: the frames of one episode, in order.
        fps: frames per second on a terminal.
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
