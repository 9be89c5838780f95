"""Make the pictures of the README and the documentation in `docs/images`.

    python docs/make_pictures.py [logo | video | gallery | benchmark | plan | trained ...]

The last one needs the extra "ppo", and trains for a minute. The same versions of the code, pygame
and Pillow give the same bytes.
"""

from __future__ import annotations

import io
import re
import shlex
import shutil
import subprocess
import sys
from pathlib import Path
from tempfile import TemporaryDirectory

import pygame
from PIL import Image

from DroneSwarmSearch import cli
from DroneSwarmSearch.commands.searches import named_search
from DroneSwarmSearch.evaluation import record
from DroneSwarmSearch.rendering import sprites

ROOT = Path(__file__).parents[1]
IMAGES = ROOT / "docs" / "images"
EXAMPLES = ROOT / "examples"

FILMS = {
    "gale": ("greedy-forecast", 3),
    "eddy": ("imitation", 3),
    "coast": ("greedy-forecast", 5),
    "fleet": ("greedy-posterior", 4),
    "wreck": ("imitation", 2),
    "wreck-together": ("rollout", 0),
}
"""The searches of the gallery: the policy and the seed of an episode that ends with a find."""

TASKS = {
    "drift": ("drift/3", "imitation"),
    "wreck": ("wreck/1", "rollout"),
    "radio": ("radio/1", "rollout"),
    "fleet": ("fleet/3", "rollout"),
}
"""For each task of the benchmark, a search, and the policy that is shown beside greedy-matrix."""

BENCHMARK_HEIGHT = 336  # pixels of a film
EVERY = 3  # pictures, of which one is kept

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
    """Record a search of each kind."""
    for name, (policy, seed) in FILMS.items():
        own = EXAMPLES / f"{name}.json"
        where = str(own) if own.exists() else name
        record(policy, where, IMAGES / f"gallery-{name}.gif", seed=seed, fps=16.0)


def benchmark() -> None:
    """Record a search of each task of the benchmark with a poor and with a good policy."""
    for task, (where, good) in TASKS.items():
        with TemporaryDirectory() as folder:
            films = [Path(folder) / f"{policy}.gif" for policy in ("greedy-matrix", good)]
            for film in films:
                record(film.stem, named_search(where), film, fps=8.0)
            beside_each_other(films, IMAGES / f"benchmark-{task}.gif")


def beside_each_other(films: list[Path], path: Path) -> None:
    """Join films of the same search into one; the shorter ones stay at their last picture."""
    opened = [Image.open(film) for film in films]
    longest = max(opened, key=lambda film: film.n_frames)
    pictures = []
    durations = []
    for number in range(0, longest.n_frames, EVERY):
        longest.seek(number)
        durations.append(EVERY * longest.info["duration"])
        row = []
        for film in opened:
            film.seek(min(number, film.n_frames - 1))
            shown = film.convert("RGB")
            width = round(shown.width * BENCHMARK_HEIGHT / shown.height)
            row.append(shown.resize((width, BENCHMARK_HEIGHT), Image.Resampling.LANCZOS))
        joined = Image.new("RGB", (sum(each.width for each in row), BENCHMARK_HEIGHT))
        left = 0
        for each in row:
            joined.paste(each, (left, 0))
            left += each.width
        pictures.append(joined)
    # One palette for all pictures, so that the sea keeps its colour.
    palette = pictures[len(pictures) // 2].quantize(255)
    pictures = [picture.quantize(palette=palette, dither=Image.Dither.NONE) for picture in pictures]
    pictures[0].save(
        path, save_all=True, append_images=pictures[1:], duration=durations, loop=0, optimize=True
    )


def plan() -> None:
    """Run the command of the guide "From a distress call to a plan"; save its map and page."""
    guide = (IMAGES.parent / "guides" / "incident.md").read_text("utf-8")
    (command,) = re.findall(r"^droneswarmsearch (plan --position .* --out) plan$", guide, re.M)
    with TemporaryDirectory() as folder:
        cli.main([*shlex.split(command), folder])
        picture = Image.open(Path(folder) / "map.png").convert("RGB")
        picture.quantize(128).save(IMAGES / "plan.png", optimize=True)
        page = Path(folder) / "plan.html"
        shutil.copy(page, ROOT / "docs" / "static" / "plan.html")
        photograph(page)


def photograph(page: Path) -> None:
    """Save pictures of a plan's page in both themes, after 15 minutes; needs Chromium."""
    from selenium import webdriver

    options = webdriver.ChromeOptions()
    for argument in ("--headless=new", "--no-sandbox", "--disable-dev-shm-usage"):
        options.add_argument(argument)
    browser = webdriver.Chrome(options=options)
    size = {"width": 1240, "height": 840, "deviceScaleFactor": 1, "mobile": False}
    browser.execute_cdp_cmd("Emulation.setDeviceMetricsOverride", size)
    for theme in ("light", "dark"):
        features = [{"name": "prefers-color-scheme", "value": theme}]
        browser.execute_cdp_cmd("Emulation.setEmulatedMedia", {"features": features})
        browser.get(page.as_uri())
        browser.execute_script(
            "const time = document.getElementById('time'); time.value = 900;"
            "time.dispatchEvent(new Event('input'));"
        )
        picture = Image.open(io.BytesIO(browser.get_screenshot_as_png())).convert("RGB")
        picture.quantize(128).save(IMAGES / f"plan-page-{theme}.png", optimize=True)
    browser.quit()


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


PICTURES = {
    "logo": logo,
    "video": video,
    "gallery": gallery,
    "benchmark": benchmark,
    "plan": plan,
    "trained": trained,
}


def main() -> None:
    """Make the pictures named on the command line, or all except `trained`."""
    IMAGES.mkdir(exist_ok=True)
    for name in sys.argv[1:] or [name for name in PICTURES if name != "trained"]:
        PICTURES[name]()


if __name__ == "__main__":
    main()
