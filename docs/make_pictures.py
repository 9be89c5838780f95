"""Make the pictures of the README and the documentation in `docs/images`.

    python docs/make_pictures.py [logo | video | gallery | plan | trained ...]

The last one needs the extra "ppo", and trains for a minute. The same versions of the code, pygame
and Pillow give the same bytes.
"""

from __future__ import annotations

import re
import shlex
import subprocess
import sys
from dataclasses import replace
from pathlib import Path
from tempfile import TemporaryDirectory

import numpy as np
import pygame
from PIL import Image

from DroneSwarmSearch import cli
from DroneSwarmSearch.evaluation import NamedSearch, View, record, search
from DroneSwarmSearch.evaluation.recording import play
from DroneSwarmSearch.frame import Frame
from DroneSwarmSearch.policies import POLICIES, make
from DroneSwarmSearch.rendering import sprites
from DroneSwarmSearch.rendering.film import Film
from DroneSwarmSearch.rendering.video import write_pictures

ROOT = Path(__file__).parents[1]
IMAGES = ROOT / "docs" / "images"

# The gallery.

SEARCH = "gale"
SHOWN = [policy for policy in POLICIES if policy != "random"]

WIDTH, FPS, STRIDE = 270, 8.0, 4
"""Width of a video in pixels, pictures per second, and steps from one picture to the next."""

LEVELS = 10
"""Shades of the map; with fewer, fewer cells change from picture to picture."""

STORY = (
    "A passenger fell from a ferry 25 minutes ago. "
    "Three drones search where the drift may have taken them."
)


def logo() -> None:
    """Save the symbol of a person, the logo of the documentation."""
    symbol = sprites.person(192)
    pixels = pygame.image.tobytes(symbol, "RGBA")
    Image.frombytes("RGBA", symbol.get_size(), pixels).save(IMAGES / "logo.png", optimize=True)


def video() -> None:
    """Record the video on the first page."""
    record("planner", "man-overboard", IMAGES / "search.gif", seed=1, title=STORY)


def gallery() -> None:
    """Record the same search with each policy, without finding anybody."""
    where = search(SEARCH)
    where = replace(where, scenario=where.scenario.replace(mission="coverage"))
    played = {policy: frames(policy, where) for policy in SHOWN}
    every = [frame for each in played.values() for frame in each]  # so that all are cropped alike
    for policy, each in played.items():
        film = Film(every, title=policy, width=WIDTH)
        path = IMAGES / f"gallery-{policy}.gif"
        write_pictures(path, map(film.pixels, each), fps=FPS, hold=3.0)


def frames(policy: str, where: NamedSearch) -> list[Frame]:
    """The frames that a video of the gallery shows."""
    return [
        replace(
            frame,
            matrix=np.rint(frame.matrix / frame.matrix.max() * LEVELS).astype(np.float32),
            ending=None,
            scale=where.scale,
        )
        for frame, _ in play(make(policy, where.scenario), where, 0, View("swarm"))
        if frame.step % STRIDE == 0 or frame.ending is not None
    ]


def plan() -> None:
    """Run the command of the guide "From a distress call to a plan", and save its map."""
    guide = (IMAGES.parent / "guides" / "incident.md").read_text("utf-8")
    (command,) = re.findall(r"^droneswarmsearch (plan --position .* --out) plan$", guide, re.M)
    with TemporaryDirectory() as folder:
        cli.main([*shlex.split(command), folder])
        picture = Image.open(Path(folder) / "map.png").convert("RGB")
        picture.quantize(64).save(IMAGES / "plan.png", optimize=True)


def trained() -> None:
    """Run the training of the tutorial, and record what it trained."""
    tutorial = (IMAGES.parent / "tutorial.md").read_text("utf-8")
    (train,) = re.findall(r"^python (examples/train_.* --out) runs/first$", tutorial, re.M)
    (policy,) = re.findall(r"play runs/first/search\.json --policy (\S+)$", tutorial, re.M)
    with TemporaryDirectory() as folder:
        subprocess.run([sys.executable, *train.split(), folder], cwd=ROOT, check=True)
        record(
            f"{ROOT}/{policy.replace('runs/first', folder)}",
            f"{folder}/search.json",
            IMAGES / "trained.gif",
            seed=27,
            name="trained",
            title="After a minute of training",
        )


PICTURES = {"logo": logo, "video": video, "gallery": gallery, "plan": plan, "trained": trained}


def main() -> None:
    """Make the pictures named on the command line, or all except `trained`."""
    IMAGES.mkdir(exist_ok=True)
    for name in sys.argv[1:] or [name for name in PICTURES if name != "trained"]:
        PICTURES[name]()


if __name__ == "__main__":
    main()
