"""Make the episodes that the page "Watch searches" shows, in `docs/static/episodes`.

    python docs/make_episodes.py

writes the file `<search>.js` of every search below, or of those given as arguments, and
`index.js`: the list of searches and policies, and the colours of `rendering/palette.py`. This takes
several minutes, mostly for the planner. The content of a file is that of

    python -m DroneSwarmSearch export SEARCH --policies ... --seeds ... --out SEARCH.json

as a script, because browsers do not let a page that was opened from a disk read other files.
"""

from __future__ import annotations

import argparse
import json
from collections.abc import Sequence
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any

from DroneSwarmSearch.evaluation import SUITE, export
from DroneSwarmSearch.rendering import palette

EPISODES = Path(__file__).parent / "static" / "episodes"

SEARCHES = ("man-overboard", "gale", "two-positions", "wreck", "fleet", "classic", "harbour")

POLICIES = {
    "planner": "Planner",
    "imitation": "Trained network",
    "greedy-posterior": "Greedy on the posterior",
    "expanding-square": "Expanding square",
    "parallel-sweep": "Parallel sweep",
}
"""The policies, with their names on the page."""

SEEDS = range(5)


def index() -> dict[str, Any]:
    """The content of `index.js`."""
    return {
        "searches": {name: SUITE[name].reason for name in SEARCHES},
        "policies": POLICIES,
        "colours": {
            "map": palette.PALETTES["sea"],
            "drones": palette.DRONES,
            "person": palette.LIFE_RING,
            "found": palette.FOUND,
            "notFound": palette.NOT_FOUND,
        },
    }


def script(key: str, data: dict[str, Any]) -> str:
    """JSON as a script that adds it to the page's data."""
    text = json.dumps(data, separators=(",", ":"), allow_nan=False)
    return f"(globalThis.searchData ??= {{}})[{json.dumps(key)}] = {text};\n"


def main(argv: Sequence[str] | None = None) -> None:
    """Make the files."""
    parser = argparse.ArgumentParser(description="Make the episodes of the documentation.")
    parser.add_argument("searches", metavar="SEARCH", nargs="*", help=f"of {', '.join(SEARCHES)}")
    searches = parser.parse_args(argv).searches or SEARCHES
    if unknown := set(searches) - set(SEARCHES):
        parser.error(f"SEARCH must be of {', '.join(SEARCHES)}, got {', '.join(sorted(unknown))}")
    EPISODES.mkdir(parents=True, exist_ok=True)
    (EPISODES / "index.js").write_text(script("index", index()), "utf-8")
    for name in searches:
        with TemporaryDirectory() as folder:
            data = export(list(POLICIES), name, Path(folder) / f"{name}.json", seeds=SEEDS)
        path = EPISODES / f"{name}.js"
        path.write_text(script(name, data), "utf-8")
        print(f"{path}: {path.stat().st_size:,} bytes")


if __name__ == "__main__":
    main()
