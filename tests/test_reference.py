"""The API reference lists exactly the public names, and the tables match the code."""

import ast
import dataclasses
import functools
import importlib
import importlib.util
import inspect
import re
from itertools import pairwise
from pathlib import Path
from typing import Any

import pytest
from helpers import tables_of

import DroneSwarmSearch as package
from DroneSwarmSearch import Action, Drift, DroneSwarmSearch, Person, RewardScheme

DOCS = Path(__file__).parents[1] / "docs"
PAGES = sorted((DOCS / "api").glob("*.rst"))
ENVIRONMENT = (DOCS / "environment.md").read_text("utf-8")

ADAPTERS = {
    "DroneSwarmSearch.adapters.sb3": "stable_baselines3",
    "DroneSwarmSearch.adapters.rllib": "ray.rllib",
    "DroneSwarmSearch.adapters.torchrl": "torchrl",
    "DroneSwarmSearch.adapters.benchmarl": "benchmarl",
}
"""Modules that are only importable where a library is installed."""

PUBLIC_MODULES = (
    "DroneSwarmSearch",
    "DroneSwarmSearch.env",
    "DroneSwarmSearch.single_drone_env",
    "DroneSwarmSearch.drift",
    "DroneSwarmSearch.geo",
    "DroneSwarmSearch.incident",
    "DroneSwarmSearch.persons.leeway",
    "DroneSwarmSearch.persons.priors",
    "DroneSwarmSearch.persons.detection",
    "DroneSwarmSearch.vector",
    *ADAPTERS,
    "DroneSwarmSearch.adapters",
    "DroneSwarmSearch.wrappers",
    "DroneSwarmSearch.policies",
    "DroneSwarmSearch.planning",
    "DroneSwarmSearch.evaluation",
    "DroneSwarmSearch.training",
    "DroneSwarmSearch.core.frame",
)

MAX_UNDESCRIBED_ARGUMENTS = 3
"""A docstring without a list of arguments may have at most this many."""


def names_on(page: Path) -> list[str]:
    """The full names of all objects documented on a page."""
    names = []
    module = ""
    for directive, name in re.findall(
        r"^\.\. (currentmodule|auto(?:class|data|exception|function)):: ([\w.]+)",
        page.read_text("utf-8"),
        re.M,
    ):
        if directive == "currentmodule":
            module = name
        else:
            names.append(name if name.startswith("DroneSwarmSearch.") else f"{module}.{name}")
    return names


DOCUMENTED = [name for page in PAGES for name in names_on(page)]


def public_names(module: str) -> list[str]:
    """The full names in a module's `__all__`, without importing it."""
    spec = importlib.util.find_spec(module)
    assert spec is not None and spec.origin is not None
    for statement in ast.parse(Path(spec.origin).read_text("utf-8")).body:
        if isinstance(statement, ast.Assign) and ast.unparse(statement.targets[0]) == "__all__":
            return [f"{module}.{name}" for name in ast.literal_eval(statement.value)]
    raise AssertionError(f"{module} has no __all__")


def load(name: str) -> Any:
    """The object with this full name."""
    module, _, attribute = name.rpartition(".")
    if module in ADAPTERS:
        pytest.importorskip(ADAPTERS[module])
    return getattr(importlib.import_module(module), attribute)


def definition(name: str) -> str:
    """Where the object is defined, so that names of one object compare equal."""
    if name.rpartition(".")[0] in ADAPTERS:
        return name
    thing = load(name)
    is_definition = inspect.isclass(thing) or inspect.isfunction(thing)
    return f"{thing.__module__}.{thing.__qualname__}" if is_definition else name


def test_the_reference_lists_every_public_name_once():
    public = {definition(name) for module in PUBLIC_MODULES for name in public_names(module)}
    assert sorted(map(definition, DOCUMENTED)) == sorted(public - {"DroneSwarmSearch.__version__"})


@pytest.mark.parametrize("name", DOCUMENTED)
def test_public_names_have_docstrings(name):
    """Constants have theirs below their definition."""
    thing = load(name)
    if inspect.isfunction(thing):
        check_docstring(thing.__doc__, thing, name)
    elif inspect.isclass(thing):
        check_class(thing, name)
    else:
        assert name.rpartition(".")[2] in documented_constants(), name


def check_class(thing: type, name: str) -> None:
    """Check the docstrings of a class, its constructor's arguments and its methods."""
    owner = next((base for base in thing.__mro__ if "__init__" in vars(base)), thing)
    is_ours = owner.__module__.startswith("DroneSwarmSearch") and not hasattr(thing, "_fields")
    is_ours &= not dataclasses.is_dataclass(owner.__base__)  # of another library
    text = f"{thing.__doc__}\n{owner.__doc__}"
    check_docstring(text, thing.__init__ if is_ours else None, name)
    for method, function in vars(thing).items():
        if not method.startswith("_") and inspect.isfunction(function):
            bases = [base for base in thing.__mro__ if method in vars(base)]
            if all(base.__module__.startswith("DroneSwarmSearch") for base in bases):
                texts = (vars(base)[method].__doc__ for base in bases)
                check_docstring(next(filter(None, texts), None), function, f"{name}.{method}")


def check_docstring(text: str | None, function: Any, name: str) -> None:
    """Check for a summary sentence, and for a description of every argument."""
    assert text, name
    assert re.match(r".*[.:;]$", text.split("\n")[0]), f"{name}: {text.splitlines()[0]}"
    parameters = [] if function is None else [*inspect.signature(function).parameters.values()]
    names = [p.name for p in parameters if p.kind is not p.VAR_POSITIONAL and p.name != "self"]
    if "Args:" in text or "Attributes:" in text:
        assert [each for each in names if not re.search(rf"\b{each}\b", text)] == [], name
    else:
        assert len(names) <= MAX_UNDESCRIBED_ARGUMENTS, name


@functools.cache
def documented_constants() -> set[str]:
    """The constants of the package with a string below their definition."""
    names: set[str] = set()
    for path in Path(package.__file__).parent.rglob("*.py"):
        body = ast.parse(path.read_text("utf-8")).body
        for statement, text in pairwise(body):
            if isinstance(statement, (ast.Assign, ast.AnnAssign)) and isinstance(text, ast.Expr):
                names |= {*re.findall(r"\w+", ast.unparse(statement).partition(" = ")[0])}
    return names


def test_the_index_lists_every_page():
    index = (DOCS / "api" / "index.rst").read_text("utf-8")
    pages = {page.stem for page in PAGES} - {"index"}
    assert set(re.findall(r":doc:`([\w-]+)`", index)) == pages
    assert set(re.findall(r"^   ([\w-]+)$", index.partition("toctree")[2], re.M)) == pages


def section(heading: str) -> str:
    """The text under a heading."""
    return re.split(r"\n#+ ", ENVIRONMENT.partition(f"## {heading}\n")[2], maxsplit=1)[0]


def rows(heading: str) -> list[list[str]]:
    """The rows of the first table under a heading, without its header."""
    return tables_of(section(heading))[0][1:]


def test_arguments_match_the_signature():
    documented = [(row[0].strip("`"), row[1].strip("`")) for row in rows("Arguments")]
    parameters = list(inspect.signature(DroneSwarmSearch).parameters.values())
    assert [name for name, _ in documented] == [parameter.name for parameter in parameters]
    for (_, default), parameter in zip(documented, parameters, strict=True):
        assert eval(default, {"RewardScheme": RewardScheme}) == parameter.default
    keyword_only = [p.name for p in parameters if p.kind is inspect.Parameter.KEYWORD_ONLY]
    assert keyword_only[0] == "probability_of_detection"  # as the environment page states


def test_reset_options_are_complete(recwarn):
    env = DroneSwarmSearch()
    valid = {"drones_positions": [(1, 1)], "vector": (0, 0), "person_initial_position": (2, 2)}
    persons = {"persons": Person(Drift((2, 2)))}
    assert re.findall(r'`"(\w+)"`', section("Reset options")) == [*valid, *persons]
    env.reset(options=valid)
    env.reset(options=persons)
    assert not recwarn
    with pytest.warns(UserWarning, match=", ".join(valid)):
        env.reset(options={"speed": 1})


def test_actions_have_the_documented_values_and_effects():
    shifts = {"x - 1": (-1, 0), "x + 1": (1, 0), "y - 1": (0, -1), "y + 1": (0, 1)}
    table = rows("Action space")
    assert [(int(value), name.strip("`")) for value, name, _ in table] == [
        (action.value, action.name) for action in Action
    ]
    for value, _, effect in table:
        env = DroneSwarmSearch()
        env.reset(seed=0, drones_positions=[(3, 3)])
        observations = env.step({"drone0": int(value)})[0]
        x, y = observations["drone0"]["observation"][0]
        assert (x - 3, y - 3) == shifts.get(effect, (0, 0))


def test_the_reward_table_has_the_values_of_the_default_scheme():
    scheme = RewardScheme()
    assert {event: (reward, fields) for event, reward, fields in rows("Rewards")} == {
        "it collided with another drone": (f"{scheme.collision:g}", "`collision`"),
        "it left the grid": (f"{scheme.leave_grid:g}", "`leave_grid`"),
        "it searched and found a person": (
            f"{scheme.find:g} + {scheme.find_early:g} (1 - t/L)",
            "`find`, `find_early`",
        ),
        "the time limit was reached, and it found nobody in this episode": (
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


def test_the_environment_page_has_the_metadata():
    summary = ENVIRONMENT.partition("## Description")[0]
    table = dict(re.findall(r"^\| ([\w ]+) \| (.+) \|$", summary, re.M))
    modes = [f'`"{mode}"`' for mode in DroneSwarmSearch.metadata["render_modes"]]
    assert table["render modes"] == ", ".join([*modes, "`None`"])
    assert table["id"].startswith(f"`{DroneSwarmSearch.metadata['name']}`")
    assert f"at most {DroneSwarmSearch.metadata['render_fps']} times a second" in ENVIRONMENT
    assert [row[0] for row in rows("Rendering")] == [*modes, "`None`"]


def test_every_version_is_in_the_history():
    number = re.findall(r"_v(\d+)$", DroneSwarmSearch.metadata["name"])[0]
    history = re.findall(r"^- `v(\d+)`", ENVIRONMENT.partition("## Version history")[2], re.M)
    assert history == [str(version) for version in reversed(range(int(number) + 1))]
