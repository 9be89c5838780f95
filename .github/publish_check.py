"""List what is left to do before this version can be published.

    python .github/publish_check.py

Exits with status 1 while something that the checkout shows is open: release.yml then uploads
nothing. The rest, on the web pages of the package index and of the repository, is for a person.
"""

from __future__ import annotations

import re
import subprocess
from pathlib import Path

ROOT = Path(__file__).parents[1]

BY_HAND = (
    "index: DroneSwarmSearchEnvironment belongs to the 2023 project; take it over, or choose"
    " another `name` in pyproject.toml",
    "index: a trusted publisher for this repository, workflow release.yml, environment pypi",
    "repository: the environment pypi, with a reviewer",
    'repository: Pages with the source "GitHub Actions", and the variable PUBLISH_PAGES = true',
    "repository: CI passed on this commit",
)


def checks(root: Path = ROOT) -> dict[str, bool]:
    """What the checkout has to show, in the order to do it, and whether it does."""

    def text(name: str) -> str:
        return (root / name).read_text("utf-8")

    def found(pattern: str, name: str) -> str:
        """The group of the pattern in the first line that matches; empty if none does."""
        match = re.search(pattern, text(name), re.M)
        return match[1] if match else ""

    version = found(r'^__version__ = "(.+)"$', "DroneSwarmSearch/__init__.py")
    date = found(rf"^## {re.escape(version)} \((\d{{4}}-\d\d-\d\d)\)$", "CHANGELOG.md")
    (module,) = (root / "DroneSwarmSearch").glob("drone_swarm_search_v*.py")
    git = ("git", "tag", "--points-at", "HEAD")
    tags = subprocess.run(git, cwd=root, capture_output=True, text=True, check=False).stdout
    return {
        "pyproject.toml: the repository's account instead of OWNER, then `just notebook`": not (
            found("(https://.*OWNER)", "pyproject.toml")
            or found("(https://.*OWNER)", "docs/tutorial.ipynb")
        ),
        f"CHANGELOG.md: the title `## {version} (YYYY-MM-DD)`": date != "",
        'CITATION.cff: the same date, `date-released: "YYYY-MM-DD"`': date != ""
        and found('^date-released: "(.+)"$', "CITATION.cff") == date,
        "README.md: the year of that date in the BibTeX": date != ""
        and found(r"^ +year += \{(.+)\},$", "README.md") == date[:4],
        f"tests/golden/released.txt: episodes of {module.stem}, `just golden --release`": bool(
            found(rf"^({module.stem}) ", "tests/golden/released.txt")
        ),
        f"git: the tag v{version} on this commit": f"v{version}" in tags.split(),
    }


def main() -> None:
    """Print the list."""
    items = checks()
    for item, done in items.items():
        print("[x]" if done else "[ ]", item)
    print("\nOnly you can see whether these are done:")
    for item in BY_HAND:
        print("[ ]", item)
    if not all(items.values()):
        raise SystemExit("\nnot ready to publish")


if __name__ == "__main__":
    main()
