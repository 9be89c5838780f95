"""The house: imports point one way, and docs/design.md shows every module."""

import ast
from collections.abc import Iterator
from functools import cache
from graphlib import TopologicalSorter
from pathlib import Path

import pytest
from helpers import module_at

ROOT = Path(__file__).parents[1]
PACKAGE = ROOT / "DroneSwarmSearch"

pytestmark = pytest.mark.skipif(not PACKAGE.exists(), reason="there is no source tree")


@cache
def modules() -> dict[str, Path]:
    paths = PACKAGE.rglob("*.py")
    return {".".join(each.relative_to(ROOT).with_suffix("").parts): each for each in paths}


def imported(path: Path) -> Iterator[str]:
    """Everything that a module imports, inside functions and for types, too."""
    for node in ast.walk(ast.parse(path.read_text("utf-8"))):
        if isinstance(node, ast.Import):
            yield from (each.name for each in node.names)
        elif isinstance(node, ast.ImportFrom):
            assert node.module and not node.level
            yield from (f"{node.module}.{each.name}" for each in node.names)


@cache
def graph() -> dict[str, set[str]]:
    """The modules that each one imports; a package stands for its `__init__`."""
    known = modules()
    imports: dict[str, set[str]] = {}
    for name, path in known.items():
        found = set()
        for each in imported(path):
            parts = each.split(".")
            names = (".".join(parts[:end]) for end in range(len(parts), 0, -1))
            found |= {next((n for n in map(_module, names) if n in known), name)}
        imports[name] = found - {name}
    return imports


def _module(name: str) -> str:
    return f"{name}.__init__" if f"{name}.__init__" in modules() else name


def test_imports_form_no_circle():
    assert [*TopologicalSorter(graph()).static_order()]


def test_rooms_import_only_those_above_them():
    design = module_at(ROOT / "docs" / "make_design.py")
    rooms = design.ROOMS
    for name, found in graph().items():
        room = name.split(".")[1]
        if room in rooms:
            inside = {each.split(".")[1] for each in found}
            above = rooms[: rooms.index(room) + 1]
            allowed = design.IN_BETWEEN if "vector" in above else ()
            assert inside <= {"__init__", *above, *allowed}, name


def test_the_page_shows_every_module():
    design = module_at(ROOT / "docs" / "make_design.py")
    assert design.page() == design.PAGE.read_text("utf-8"), "run python docs/make_design.py"
    assert {each.name for each in PACKAGE.iterdir() if each.is_dir()} - {"__pycache__"} == {
        *design.ROOMS
    }
