"""Test the migration guides from the 2023 package and from DSSE.

Blocks marked ``py`` are scripts for the other package. A script followed by a text block must
raise the error in that block; all others must run.
"""

import ast
import dataclasses
import importlib
import inspect
import os
import re
import subprocess
import sys
from pathlib import Path

import pytest
from helpers import tables_of

import DroneSwarmSearch as package
from DroneSwarmSearch import DroneSwarmSearch, Ending, RewardScheme

GUIDES = Path(__file__).parents[1] / "docs" / "guides"
OF_2023 = (GUIDES / "from-2023.md").read_text("utf-8")
OF_DSSE = (GUIDES / "from-dsse.md").read_text("utf-8")
FIRST_NINE = tuple(inspect.signature(DroneSwarmSearch).parameters)[:9]


def section(page: str, title: str) -> str:
    """Return the text under a heading, up to the next one of level 1 or 2."""
    found = re.search(
        rf"^(#+) {re.escape(title)}\n(.*?)(?=^#{{1,2}} |\Z)", page, re.MULTILINE | re.DOTALL
    )
    assert found, title
    return found[2]


def rows(text: str) -> list[list[str]]:
    """Return the rows of a text's tables, without their headings."""
    return [row for table in tables_of(text) for row in table[1:]]


def code(cell: str) -> str:
    """Return the first code span of a cell."""
    found = re.search(r"`([^`]+)`", cell)
    assert found, cell
    return found[1]


def scripts(page: str) -> list[object]:
    """Return the scripts for the other package, each with the error that it must raise, if any."""
    blocks = re.findall(
        r"^```py\n(.*?)^```\n(?:\n```text\n(.*?)\n```\n)?", page, re.MULTILINE | re.DOTALL
    )
    return [pytest.param(*block, id=f"{n}") for n, block in enumerate(blocks)]


def environment() -> DroneSwarmSearch:
    """Return the environment that the fragments of the guide use."""
    return DroneSwarmSearch(grid_size=10, n_drones=2, person_initial_position=[5, 5])


@pytest.mark.parametrize(("script", "error"), scripts(OF_2023))
def test_script_of_2023(script, error):
    names = {"env": environment()}
    if not error:
        exec(compile(script, "before", "exec"), names)
        return
    with pytest.raises((Exception,)) as caught:
        exec(compile(script, "before", "exec"), names)
    assert f"{type(caught.value).__name__}: {caught.value}" == error


def run(script: str, folder: Path, path: str = "") -> str:
    """Run a script in its own process, and return its output."""
    done = subprocess.run(
        [sys.executable, "-c", script],
        cwd=folder,
        env={**os.environ, "SDL_VIDEODRIVER": "dummy", "PYTHONPATH": path},
        capture_output=True,
        text=True,
        timeout=60,
        check=False,
    )
    assert (done.returncode, done.stderr) == (0, "")
    return done.stdout


def test_import_path_of_the_2023_repository(tmp_path):
    line = re.search(r"```py\n(from DroneSwarmSearchEnvironment.env .*?)```", OF_2023, re.DOTALL)
    file = tmp_path / "core" / "environment" / "env.py"
    file.parent.mkdir(parents=True)
    file.write_text(line[1], encoding="utf-8")
    script = "from core.environment.env import DroneSwarmSearch\nprint(DroneSwarmSearch)"
    checkout = str(Path(package.__file__).parents[1])
    assert "DroneSwarmSearch.env.DroneSwarmSearch" in run(script, tmp_path, checkout)


# As users of the 2023 package wrote it.
WHOLE_SCRIPT = """\
from DroneSwarmSearchEnvironment.env import DroneSwarmSearch
env = DroneSwarmSearch(20, "ansi", False, True, 3, [0.2, 0.2], [0, 5], 5, 30)
env.reset(drones_positions=[[5, 5], [15, 5], [5, 15]], vector=(0.3, 0.3))
found, score = False, 0
for _ in range(30):
    observations, reward, _, done, info = env.step({d: 4 for d in env.get_agents()})
    score += reward["total_reward"]
    found = found or info["Found"]
    if any(done.values()):
        break
(x, y), matrix = observations["drone2"]["observation"]
assert (x, y) == (5, 15) and matrix[y][x] >= 0 and (found or score < 0)
env.reset()
assert list(env.vector) == [0.3, 0.3]
env.close()
env.close()
"""


def test_whole_script_of_2023():
    exec(compile(WHOLE_SCRIPT, "script", "exec"), {})


README_SCRIPT = """\
from DroneSwarmSearchEnvironment.env import DroneSwarmSearch
env = DroneSwarmSearch(
    grid_size=50,
    render_mode="human",
    render_grid = True,
    render_gradient = True,
    n_drones=11,
    vector=[0.5, 0.5],
    person_initial_position = [5, 10],
    disperse_constant = 3)

def policy(obs, agent):
    actions = {}
    for i in range(11):
        actions["drone{}".format(i)] = 1
    return actions

observations = env.reset()
rewards = 0
done = False

while not done:
    actions = policy(observations, env.get_agents())
    observations, reward, _, done, info = env.step(actions)
    rewards += reward["total_reward"]
    done = True if True in [e for e in done.values()] else False

print(rewards)
"""
"""The sample script in the README of the 2023 package."""

WITHOUT_PAUSES = """
from DroneSwarmSearch import DroneSwarmSearch
DroneSwarmSearch.metadata["render_fps"] = 1000
"""


def test_readme_script_of_2023(tmp_path):
    checkout = str(Path(package.__file__).parents[1])
    printed = run(WITHOUT_PAUSES + README_SCRIPT, tmp_path, checkout)
    # The drones start in columns 0 to 10 and move right: 39 steps with a reward of 1 each; in
    # the next step, drone 10 leaves the grid from column 49.
    assert float(printed) == 39 * 11 + 10 - 100_000


def test_parameters_of_2023():
    table = {code(row[0]): row[1] for row in rows(section(OF_2023, "Parameters"))}
    signature = inspect.signature(DroneSwarmSearch).parameters
    assert tuple(table) == FIRST_NINE
    for name, default in table.items():
        value = ast.literal_eval(code(default))
        assert (tuple(value) if isinstance(value, list) else value) == signature[name].default
    for name in tuple(signature)[9:]:
        assert f"`{name}`" in section(OF_2023, "Parameters")


def test_rewards_of_2023():
    table = rows(section(OF_2023, "Rewards"))
    figures = {code(row[2]): float(code(row[1])) for row in table}
    flags = {"expected_finds": False, "given_misses": False}
    assert {**figures, **flags} == dataclasses.asdict(RewardScheme())


def test_endings_of_2023():
    table = {code(row[1]) for row in rows(section(OF_2023, "Endings"))}
    assert table == {ending.name for ending in Ending if ending is not Ending.COVERED}


@pytest.mark.parametrize("row", rows(section(OF_2023, "Attributes")), ids=lambda row: code(row[0]))
def test_attribute_of_2023(row):
    env = environment()
    env.reset()
    before, now = row
    with pytest.raises(AttributeError):
        eval(code(before), {"env": env})
    if not now.startswith("none"):
        assert eval(code(now), {"env": env}) is not None


def test_methods_of_2023():
    calls = [code(row[0]) for row in rows(section(OF_2023, "Methods"))]
    for call in calls:
        env = DroneSwarmSearch(grid_size=30, n_drones=2)
        env.reset()
        names = {"env": env, "actions": dict.fromkeys(env.get_agents(), 5)}
        if "return_info" in call:
            with pytest.raises(TypeError, match="return_info"):
                eval(call, names)
        else:
            eval(call, names)
    public = {"reset", "step", "get_agents", "render", "close"}
    assert {re.match(r"env\.(\w+)", call)[1] for call in calls} == public


def dsse_parameters(name: str) -> list[list[str]]:
    """Return the parameters in a section: name, default, counterpart."""
    return [row for row in rows(section(OF_DSSE, name)) if len(row) == 3]


def test_parameters_here():
    here = set(inspect.signature(DroneSwarmSearch).parameters)
    for row in dsse_parameters("Parameters") + dsse_parameters("Coverage"):
        if row[2].startswith("`"):
            assert code(row[2]) in here
    assert "`grid_size`, 7 by default" in OF_DSSE
    assert inspect.signature(DroneSwarmSearch).parameters["grid_size"].default == 7


def test_attributes_and_wrappers_here():
    env = environment()
    env.reset()
    here = {"env": env, **vars(importlib.import_module("DroneSwarmSearch.wrappers"))}
    expressions = re.findall(
        r"`((?:env\.(?:frame|scenario|get_agents|possible)|len\(env|\w+\(env)[^`]*)`",
        "\n".join(row[-1] for row in rows(section(OF_DSSE, "Observations, infos, spaces"))),
    )
    assert len(expressions) == 10
    for expression in expressions:
        assert eval(expression, here) is not None
