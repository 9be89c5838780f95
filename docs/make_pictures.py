"""Draw the images of the README and the documentation, in `docs/images`.

    python docs/make_pictures.py

The same code and versions of pygame and Pillow produce the same bytes.
"""

from __future__ import annotations

import itertools
from pathlib import Path

import pygame
from PIL import Image

from DroneSwarmSearch import DroneSwarmSearch, Ending, demo
from DroneSwarmSearch.policies import GreedyPolicy
from DroneSwarmSearch.rendering import colours, sprites

IMAGES = Path(__file__).parent / "images"

SEED = 12
"""The seed of the recorded search, and the first one tried for the other images."""

SIZE, DRONES = 20, 4
CORNERS = [(0, 0), (SIZE - 1, 0), (SIZE - 1, SIZE - 1), (0, SIZE - 1)]


def last_picture(name: str, ending: Ending) -> None:
    """Save the last image of the first search with this ending."""
    env = DroneSwarmSearch(
        grid_size=SIZE,
        render_mode="rgb_array",
        render_grid=True,
        n_drones=DRONES,
        vector=(0.2, 0.1),
        person_initial_position=(SIZE // 2, SIZE // 2),
        disperse_constant=3,
        bayesian_update=True,
    )
    policy = GreedyPolicy(env.scenario)
    for seed in itertools.count(SEED):
        observations, _ = env.reset(seed, drones_positions=CORNERS)
        policy.reset()
        while env.agents:
            observations, *_ = env.step(policy(observations))
        if env.frame().ending is ending:
            break
    Image.fromarray(env.render()).save(IMAGES / name, optimize=True)


def logo(name: str, side: int = 192) -> None:
    """Save the symbol of a drone, the logo of the documentation."""
    symbol = sprites.drone(side, colours.drone_colour(0))
    pixels = pygame.image.tobytes(symbol, "RGBA")
    Image.frombytes("RGBA", symbol.get_size(), pixels).save(IMAGES / name, optimize=True)


def main() -> None:
    """Write all images."""
    IMAGES.mkdir(exist_ok=True)
    logo("logo.png")
    demo.main(["--seed", str(SEED), "--record", str(IMAGES / "search.gif")])
    last_picture("found.png", Ending.FOUND)
    last_picture("not_found.png", Ending.TIME_LIMIT)


if __name__ == "__main__":
    main()
