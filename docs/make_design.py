"""Write the table of the package in docs/design.md, from the modules' first lines.

python docs/make_design.py
"""

from __future__ import annotations

import ast
from pathlib import Path

ROOT = Path(__file__).parents[1]
PAGE = ROOT / "docs" / "design.md"
BEGIN = "<!-- package: python docs/make_design.py -->\n```\n"
END = "```\n<!-- /package -->\n"

# The rooms, each of which imports only those above it.
ROOMS = [
    "_internal",
    "geo",
    "persons",
    "drift",
    "core",
    "rendering",
    "layouts",
    "vector",
    "paths",
    "bound",
    "planning",
    "policies",
    "adapters",
    "evaluation",
    "training",
    "incident",
    "commands",
]

ROOMS_AND_PARTS = [*ROOMS[:-1], "incident/files", ROOMS[-1]]

IN_BETWEEN = "env", "wrappers", "single_drone_env"
"""Modules of the root that combine rooms from `core` to `vector`."""


def first_line(path: Path) -> str:
    """The first line of a module's docstring."""
    return (ast.get_docstring(ast.parse(path.read_text("utf-8"))) or "").partition("\n")[0]


def table() -> str:
    """A line for each room and module: its name, and what it is."""
    package = ROOT / "DroneSwarmSearch"
    lines = []
    for room in ["", *ROOMS_AND_PARTS]:
        modules = sorted((package / room).glob("*.py"))
        about = first_line(package / room / "__init__.py")
        lines.append(f"{f'DroneSwarmSearch/{room}' if room else 'DroneSwarmSearch'}/  {about}")
        named = [each for each in modules if each.stem != "__init__"]
        width = max(len(each.name) for each in named)
        lines += [f"  {each.name:<{width}}  {first_line(each)}" for each in named]
    return "\n".join(lines) + "\n"


def page() -> str:
    """The page with the table as it should be."""
    before, _, rest = PAGE.read_text("utf-8").partition(BEGIN)
    return before + BEGIN + table() + END + rest.partition(END)[2]


if __name__ == "__main__":
    PAGE.write_text(page(), "utf-8")
