"""Make the pictures of the README and the documentation in `docs/images`.

    python docs/make_pictures.py [logo | video | gallery | plan ...]

The same versions of the code, pygame and Pillow give the same bytes.
"""

from __future__ import annotations

import re
import shlex
import sys
from collections.abc import Iterator
from dataclasses import replace
from pathlib import Path
from tempfile import TemporaryDirectory

import numpy as np
import pygame
from numpy.typing import NDArray
from PIL import Image

from DroneSwarmSearch import cli
from DroneSwarmSearch.evaluation import NamedSearch, record, search
from DroneSwarmSearch.evaluation.recording import play
from DroneSwarmSearch.frame import Frame
from DroneSwarmSearch.policies import POLICIES, make
from DroneSwarmSearch.rendering import palette, sprites
from DroneSwarmSearch.rendering.painter import to_array
from DroneSwarmSearch.rendering.search_map import LEFT, TOP, SearchMap
from DroneSwarmSearch.rendering.video import write_pictures

IMAGES = Path(__file__).parent / "images"

# The gallery.

SEARCH = "gale"
SHOWN = [policy for policy in POLICIES if policy != "random"]

WIDTH, FPS, STRIDE = 270, 8.0, 4
"""Width of a video in pixels, pictures per second, and steps from one picture to the next."""

CROP = slice(7, 37), slice(5, 35)
"""The rows and columns that the videos show, which hold all of the action."""

LEVELS = 10
"""Shades of the map; with fewer, fewer cells change from picture to picture."""

HEAD, FONT = 30, 23
"""The line above the map: its height and font size."""


def logo() -> None:
    """Save the symbol of a drone, the logo of the documentation."""
    symbol = sprites.drone(192, 0)
    pixels = pygame.image.tobytes(symbol, "RGBA")
    Image.frombytes("RGBA", symbol.get_size(), pixels).save(IMAGES / "logo.png", optimize=True)


def video() -> None:
    """Record the video on the first page."""
    record("greedy-posterior", "man-overboard", IMAGES / "search.gif", seed=9)


def gallery() -> None:
    """Record the same search with each policy, without finding anybody."""
    where = search(SEARCH)
    where = replace(where, scenario=where.scenario.replace(mission="coverage"))
    for policy in SHOWN:
        path = IMAGES / f"gallery-{policy}.gif"
        write_pictures(path, tiles(policy, where), fps=FPS, hold=3.0, gif_width=WIDTH)


def tiles(policy: str, where: NamedSearch) -> Iterator[NDArray[np.uint8]]:
    """The pictures of a video of the gallery."""
    rows = CROP[0]
    drawing = SearchMap(rows.stop - rows.start, palette.Look(palette="sea"), side=WIDTH)
    for frame, _ in play(make(policy, where.scenario), where, seed=0):
        if frame.step % STRIDE and frame.ending is None:
            continue
        canvas = pygame.Surface(drawing.size, 0, 32)
        shown = cropped(frame)
        drawing.draw(canvas, shown, shown, 0.0)
        picture = pygame.Surface((drawing.side, HEAD + drawing.side), 0, 32)
        picture.fill(palette.PAPER)
        picture.blit(canvas, (0, HEAD), pygame.Rect(LEFT, TOP, drawing.side, drawing.side))
        sprites.write(picture, policy, FONT, palette.INK, midleft=(4, HEAD // 2))
        success = f"{frame.probability_of_success:.0%}"
        sprites.write(picture, success, FONT, palette.INK, midright=(drawing.side - 4, HEAD // 2))
        yield to_array(picture)


def cropped(frame: Frame) -> Frame:
    """The part of a frame that the gallery shows."""
    top, left = (part.start for part in CROP)
    shown = frame.matrix[CROP]
    return replace(
        frame,
        matrix=np.rint(shown / shown.max() * LEVELS).astype(np.float32),
        drones=tuple((x - left, y - top) for x, y in frame.drones),
        trails=tuple(tuple((x - left, y - top) for x, y in trail) for trail in frame.trails),
        searched=tuple((x - left, y - top, age) for x, y, age in frame.searched),
        ending=None,
    )


def plan() -> None:
    """Run the command of the guide "From a distress call to a plan", and save its map."""
    guide = (IMAGES.parent / "guides" / "incident.md").read_text("utf-8")
    (command,) = re.findall(r"^droneswarmsearch (plan --position .* --out) plan$", guide, re.M)
    with TemporaryDirectory() as folder:
        cli.main([*shlex.split(command), folder])
        picture = Image.open(Path(folder) / "map.png").convert("RGB")
        picture.quantize(64).save(IMAGES / "plan.png", optimize=True)


PICTURES = {"logo": logo, "video": video, "gallery": gallery, "plan": plan}


def main() -> None:
    """Make the pictures named on the command line, or all of them."""
    IMAGES.mkdir(exist_ok=True)
    for name in sys.argv[1:] or PICTURES:
        PICTURES[name]()


if __name__ == "__main__":
    main()
