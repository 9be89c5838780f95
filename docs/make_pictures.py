"""Makes the pictures of the README and the documentation in `docs/images`.

    python docs/make_pictures.py

They are deterministic: the same code, pygame and Pillow give the same bytes.
"""

from __future__ import annotations

from pathlib import Path

from PIL import Image

from DroneSwarmSearch import DroneSwarmSearch, demo
from DroneSwarmSearch.policies import GreedyPolicy

IMAGES = Path(__file__).parent / "images"

FOUND, NOT_FOUND = 12, 31
"""Seeds of a search that succeeds and of one that does not."""

SIZE, DRONES = 20, 4
CORNERS = [(0, 0), (SIZE - 1, 0), (SIZE - 1, SIZE - 1), (0, SIZE - 1)]


def last_picture(name: str, seed: int) -> None:
    """Save the picture of a search's end."""
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
    policy = GreedyPolicy(SIZE)
    observations, _ = env.reset(seed, drones_positions=CORNERS)
    while env.agents:
        observations, *_ = env.step(policy(observations))
    Image.fromarray(env.render()).save(IMAGES / name, optimize=True)


def main() -> None:
    """Make them all."""
    IMAGES.mkdir(exist_ok=True)
    demo.main(["--seed", str(FOUND), "--record", str(IMAGES / "search.gif")])
    last_picture("found.png", FOUND)
    last_picture("not_found.png", NOT_FOUND)


if __name__ == "__main__":
    main()
