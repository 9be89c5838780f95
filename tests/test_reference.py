"""The reference holds every public name once, and its tables say what the code says."""

from __future__ import annotations

import ast
import importlib
import inspect
import re
from collections import Counter
from itertools import pairwise
from pathlib import Path
from typing import Any

import pytest
from helpers import tables_of

import DroneSwarmSearch as package
from DroneSwarmSearch import Action, DroneSwarmSearch, RewardScheme

DOCS = Path(__file__).parents[1] / "docs"
ENVIRONMENT = (DOCS / "environment.md").read_text("utf-8")
README = (DOCS.parent / "README.md").read_text("utf-8")

PUBLIC = (
    "DroneSwarmSearch",
    "DroneSwarmSearch.drone_swarm_search_v0",
    "DroneSwarmSearch.env",
    "DroneSwarmSearch._internal.errors",
    "DroneSwarmSearch.evaluation",
    "DroneSwarmSearch.evaluation.leaderboard",
    "DroneSwarmSearch.evaluation.record",
    "DroneSwarmSearch.evaluation.statistics",
    "DroneSwarmSearch.wrappers.layouts",
    "DroneSwarmSearch.wrappers.dictionary",
    "DroneSwarmSearch.wrappers.flat",
    "DroneSwarmSearch.wrappers.crops",
    "DroneSwarmSearch.wrappers.planes",
    "DroneSwarmSearch.wrappers.top_cells",
    "DroneSwarmSearch._internal.mappings",
    "DroneSwarmSearch.wrappers.masks",
    "DroneSwarmSearch.planning",
    "DroneSwarmSearch.planning.chain",
    "DroneSwarmSearch.planning.exact",
    "DroneSwarmSearch.planning.paths",
    "DroneSwarmSearch.planning.plan",
    "DroneSwarmSearch.policies",
    "DroneSwarmSearch.policies.ppo",
    "DroneSwarmSearch.drift",
    "DroneSwarmSearch.rendering.frame",
    "DroneSwarmSearch.rules",
    "DroneSwarmSearch.scenario",
    "DroneSwarmSearch.training",
    "DroneSwarmSearch.vector",
    "DroneSwarmSearch.vector.sb3",
    "DroneSwarmSearch.wrappers",
)
"""The modules whose names are public. The others are the package's own affair, but for what
the reference adds of them because public names return or take it."""

MOST_WITHOUT_SECTION = 3
"""Arguments that a docstring may leave to its sentence."""

COMMANDS = {"main"}  # of the command line, which has a page of its own


PAGES = sorted((DOCS / "api").glob("*.rst"))
SB3 = "DroneSwarmSearch.vector.sb3"  # imports what may not be installed


def described_on(page: Path) -> list[str]:
    """Every name that a page of the reference describes, with its path."""
    names, module = [], ""
    for kind, given in re.findall(
        r"^\.\. (currentmodule|auto(?:class|data|exception|function)|py:data):: ([\w.]+)",
        page.read_text("utf-8"),
        re.M,
    ):
        if kind == "currentmodule":
            module = given
        else:
            names.append(given if given.startswith(f"{PUBLIC[0]}.") else f"{module}.{given}")
    return names


REFERENCE = [path for page in PAGES for path in described_on(page)]


CONSTANTS = [name for name in (path.rpartition(".")[2] for path in REFERENCE) if name.isupper()]


def found(path: str) -> Any:
    """What a path leads to."""
    module, _, name = path.rpartition(".")
    if module == SB3:
        pytest.importorskip("stable_baselines3")
    return getattr(importlib.import_module(module), name)


def identity(path: str) -> str:
    """What tells whether two paths are of one thing: where it was defined, or the path."""
    if path.startswith(SB3):
        return path
    thing = found(path)
    defined = inspect.isclass(thing) or inspect.isfunction(thing)
    return f"{thing.__module__}.{thing.__qualname__}" if defined else path


@pytest.mark.parametrize("module", PUBLIC)
def test_every_public_name_is_in_the_reference(module: str) -> None:
    if module == SB3:
        pytest.importorskip("stable_baselines3")
    described = {identity(path) for path in REFERENCE}
    names = [name for name in importlib.import_module(module).__all__ if name not in COMMANDS]
    assert names
    assert [name for name in names if identity(f"{module}.{name}") not in described] == []


def test_no_name_is_in_the_reference_twice() -> None:
    counted = Counter(identity(path) for path in REFERENCE)
    assert [path for path, times in counted.items() if times > 1] == []


@pytest.mark.parametrize("path", REFERENCE)
def test_names_in_the_reference_are_public_and_described(path: str) -> None:
    thing = found(path)
    module, _, name = path.rpartition(".")
    assert name in importlib.import_module(module).__all__
    if inspect.isfunction(thing):
        check_docstring(thing.__doc__, thing, path)
    elif inspect.isclass(thing):
        made_in = next((kind for kind in thing.__mro__ if "__init__" in vars(kind)), thing)
        own = made_in.__module__.startswith("DroneSwarmSearch") and not hasattr(thing, "_fields")
        words = f"{thing.__doc__}\n{made_in.__doc__}"
        check_docstring(words, thing.__init__ if own else None, path)
        for method, function in vars(thing).items():
            if not method.startswith("_") and inspect.isfunction(function):
                words = next(
                    vars(kind)[method].__doc__
                    for kind in thing.__mro__
                    if method in vars(kind) and vars(kind)[method].__doc__
                )
                check_docstring(words, function, f"{path}.{method}")


def test_constants_in_the_reference_are_described() -> None:
    """By the string under them, wherever that is."""
    described: set[str] = set()
    for module in Path(package.__file__).parent.rglob("*.py"):
        for statement, text in pairwise(ast.parse(module.read_text("utf-8")).body):
            if isinstance(statement, (ast.Assign, ast.AnnAssign)) and isinstance(text, ast.Expr):
                described |= {*re.findall(r"\w+", ast.unparse(statement).partition(" = ")[0])}
    assert {*CONSTANTS} - described == set()


def check_docstring(text: str | None, function: Any, path: str) -> None:
    """A sentence that says what something is, and words about every argument."""
    assert text, path
    assert re.match(r".*[.:;]$", text.split("\n")[0]), f"{path}: {text.splitlines()[0]}"
    given = [] if function is None else [*inspect.signature(function).parameters.values()]
    named = [p.name for p in given if p.kind is not p.VAR_POSITIONAL and p.name != "self"]
    if "Args:" in text or "Attributes:" in text:
        assert [name for name in named if not re.search(rf"\b{name}\b", text)] == [], path
    else:  # the sentence has to do
        assert len(named) <= MOST_WITHOUT_SECTION, path


def test_the_index_names_every_page() -> None:
    index = (DOCS / "api" / "index.rst").read_text("utf-8")
    pages = {page.stem for page in PAGES} - {"index"}
    assert set(re.findall(r":doc:`([\w-]+)`", index)) == pages
    assert set(re.findall(r"^   ([\w-]+)$", index.partition("toctree")[2], re.M)) == pages


@pytest.mark.parametrize("page", PAGES, ids=lambda page: page.stem)
def test_the_table_of_a_page_holds_what_is_on_it(page: Path) -> None:
    text = page.read_text("utf-8")
    table = re.findall(r"^   ~(DroneSwarmSearch\.[\w.]+)$", text, re.M)
    assert len(table) == len(set(table))
    callables = {path for path in described_on(page) if not path.rpartition(".")[2].isupper()}
    assert set(table) <= set(described_on(page))
    assert callables - set(table) - {"DroneSwarmSearch.__version__"} == set()


# The environment's page, and what the README has of it.


def rows(heading: str, page: str = ENVIRONMENT) -> list[list[str]]:
    """The cells of the first table under a heading, without its first line."""
    section = re.split(r"\n#+ ", page.partition(f"## {heading}\n")[2], maxsplit=1)[0]
    return tables_of(section)[0][1:]


@pytest.mark.parametrize(
    "table",
    [rows("Arguments"), rows("Parameters", README)],
    ids=["environment.md", "README.md"],
)
def test_arguments_are_those_of_the_signature(table: list[list[str]]) -> None:
    told = [(row[0].strip("`"), row[1].strip("`")) for row in table]
    parameters = list(inspect.signature(DroneSwarmSearch).parameters.values())
    assert [name for name, _ in told] == [parameter.name for parameter in parameters]
    for (_, default), parameter in zip(told, parameters, strict=True):
        assert eval(default, {"RewardScheme": RewardScheme}) == parameter.default
    keywords = [p.name for p in parameters if p.kind is inspect.Parameter.KEYWORD_ONLY]
    assert keywords == [name for name, _ in told][-5:]  # "The last five are keyword only."


def test_reset_options_are_those_that_there_are(recwarn: pytest.WarningsRecorder) -> None:
    env = DroneSwarmSearch()
    valid = {
        "drones_positions": [(1, 1)],
        "vector": (0, 0),
        "person_initial_position": (2, 2),
    }
    assert [row[0].strip('`"') for row in rows("Reset options")] == list(valid)
    env.reset(options=valid)
    assert not recwarn
    with pytest.warns(UserWarning, match="options may hold " + ", ".join(valid)):
        env.reset(options={"speed": 1})


def test_actions() -> None:
    told = [(int(value), name.strip("`")) for value, name, _ in rows("Action space")]
    assert told == [(action.value, action.name) for action in Action]


def test_actions_move_as_told() -> None:
    shifts = {"x - 1": (-1, 0), "x + 1": (1, 0), "y - 1": (0, -1), "y + 1": (0, 1)}
    for value, _, told in rows("Action space"):
        env = DroneSwarmSearch()
        env.reset(seed=0, drones_positions=[(3, 3)])
        observations = env.step({"drone0": int(value)})[0]
        x, y = observations["drone0"]["observation"][0]
        assert (x - 3, y - 3) == shifts.get(told, (0, 0))


def test_figures_of_the_reward_table() -> None:
    scheme = RewardScheme()
    table = {event: (reward, fields) for event, reward, fields in rows("Rewards")}
    assert table == {
        "it collided with another drone": (f"{scheme.collision:g}", "`collision`"),
        "it left the grid": (f"{scheme.leave_grid:g}", "`leave_grid`"),
        "it searched and found a person": (
            f"{scheme.find:g} + {scheme.find_early:g} (1 - t/L)",
            "`find`, `find_early`",
        ),
        "the time is up, and it found nobody in the whole episode": (
            f"{scheme.timeout:g} - (sum of its rewards so far)",
            "`timeout`",
        ),
        f"it searched and found nobody, and p > {scheme.search_threshold:g}": (
            f"{scheme.search:g} p",
            "`search`, `search_threshold`",
        ),
        f"it searched and found nobody, and p ≤ {scheme.search_threshold:g}": (
            f"{scheme.search_unlikely:g}",
            "`search_unlikely`",
        ),
        "anything else": (f"{scheme.step:g}", "`step`"),
    }


def test_the_readme_has_the_same_rewards() -> None:
    """It tells the threshold with its own words, in per cent."""
    here = [reward for _, reward, _ in rows("Rewards")]
    there = [reward for _, reward in rows("Rewards", README)]
    assert len(there) == len(here) - 1
    assert there[:3] == here[:3] and there[-1] == here[-1]
    assert there[3] == "-(sum of its rewards so far) - 100000"
    assert there[4] == f"{here[4]} if 100 p > 1, else {here[5]}"


def test_metadata() -> None:
    first = ENVIRONMENT.partition("## Description")[0]
    table = dict(re.findall(r"^\| ([\w ]+) \| (.+) \|$", first, re.M))
    modes = [f'`"{mode}"`' for mode in DroneSwarmSearch.metadata["render_modes"]]
    assert table["render modes"] == ", ".join([*modes, "`None`"])
    assert table["id"].startswith(f"`{DroneSwarmSearch.metadata['name']}`")
    assert f"at most {DroneSwarmSearch.metadata['render_fps']} times a second" in ENVIRONMENT
    modes_told = [row[0].strip("`") for row in rows("Rendering")]
    assert modes_told == [f'"{mode}"' for mode in DroneSwarmSearch.metadata["render_modes"]] + [
        "None"
    ]


def test_every_version_is_in_the_history() -> None:
    number = re.findall(r"_v(\d+)$", DroneSwarmSearch.metadata["name"])[0]
    history = re.findall(r"^- `v(\d+)`", ENVIRONMENT.partition("## Version history")[2], re.M)
    assert history == [str(version) for version in reversed(range(int(number) + 1))]
