"""Code blocks, commands and links of the README and the documentation work."""

import contextlib
import functools
import importlib.util
import io
import itertools
import os
import re
import runpy
import shlex
import shutil
import subprocess
import sys
from pathlib import Path
from typing import NamedTuple

import numpy as np
import pytest
from documents import DOCS, PAGES, ROOT, blocks, path_of
from helpers import few_pictures
from trainer_examples import QUIET_RAY

from DroneSwarmSearch import cli
from DroneSwarmSearch.bound import success as bound
from DroneSwarmSearch.incident import choice, planning

PAGES_WITH_LINKS = [*sorted(ROOT.glob("*.md")), *DOCS]


SLOW_PAGES = (
    "docs/benchmark/",
    "docs/contributing.md",
    "docs/guides/training.md",
    "docs/guides/trainers/",
    "docs/leaderboard/",
    "docs/model.md",
    "docs/open-problems.md",
    "docs/performance.md",
)
"""Pages whose commands may take minutes or need optional packages."""

# Sub-commands that take seconds, on these pages too.
QUICK_COMMANDS = ("bound", "evaluate", "export", "play", "record")
MOST = {"--episodes": 10, "--searches": 1}  # at most so many are played, or sampled

# A part of what these scripts print.
OUTPUT = {
    "basic_env.py": "return",
    "examples/evaluate_your_own.py": "greedy-posterior: found",
    "examples/random_searches.py": "imitation ahead",
}
BENCH_BRIEFLY = "--rounds 1 --steps 20 --environments 20"
TIMEOUT = 120.0  # seconds for a command; code blocks with an RL library get five times as long


@pytest.fixture
def brief_plans(monkeypatch):
    """Let plans take little work: few persons and few patterns."""
    monkeypatch.setattr(planning, "FEW", 200)
    monkeypatch.setattr(planning, "MANY", 300)
    monkeypatch.setattr(planning, "FIGURES", 1000)
    monkeypatch.setattr(planning, "LAPS", 1)
    monkeypatch.setattr(planning, "QUICK", 1)
    monkeypatch.setattr(choice, "GENERATIONS", 1)
    monkeypatch.setattr(choice, "BOXES_DRAWN", 6)
    monkeypatch.setattr(choice, "DRAWN", 6)


def fleets() -> dict[str, str]:
    """The files of fleets that pages show, "`bases.csv` and its command", by name."""
    found = {}
    for page in PAGES:
        shown = re.findall(
            r"`(\w+\.csv)` and its command.*?^```text\n(.*?)^```$",
            page.read_text("utf-8"),
            re.M | re.S,
        )
        found |= dict(shown)
    return found


@pytest.fixture(autouse=True)
def quick_bounds(monkeypatch):
    """Let bounds take little work: few trajectories and iterations, and drones without memory."""
    monkeypatch.setattr(bound, "SAMPLE", 2**14)
    monkeypatch.setattr(bound, "WORK", 0.0)
    monkeypatch.setattr(bound, "MOST_WORK", 0.0)
    monkeypatch.setattr(bound, "ITERATIONS", 20)


def block_params() -> list[object]:
    """The Python blocks as test parameters, but those of the tutorial: see test_notebook."""
    params: list[object] = []
    for block in blocks("python"):
        if block.name.startswith("docs/tutorial.md"):
            continue
        marks = [pytest.mark.slow] * ("ray" in block.optional_packages)
        if block.output is not None and "planner" in block.text:
            marks.append(pytest.mark.good_plans)  # the page shows what such plans reach
        params.append(pytest.param(block, id=block.test_id, marks=marks))
    return params


@pytest.mark.thorough
@pytest.mark.filterwarnings("default")
@pytest.mark.parametrize("block", block_params())
def test_python_block(block, tmp_path, monkeypatch):
    """Every block runs in an empty folder and prints what the page shows."""
    for package in block.optional_packages:
        skip_without(package)
    if '"drift.nc"' in block.text:
        write_drift(tmp_path / "drift.nc")
    if block.optional_packages:  # a separate process, because libraries leave threads running
        printed = run_python(["-c", block.text], tmp_path, 5 * TIMEOUT)
    else:
        monkeypatch.chdir(tmp_path)
        hide_the_display(monkeypatch)
        with contextlib.redirect_stdout(io.StringIO()) as output:
            exec(compile(block.text, block.name, "exec"), {"__name__": "__main__"})
        printed = output.getvalue()
    assert printed.strip()
    if block.output is not None:
        assert printed.rstrip() == block.output.rstrip()


def write_drift(path: Path) -> None:
    """The file of a drift simulation: from noon, two hours to the east, where some strand."""
    from test_track_files import write  # skips the test without netCDF4

    rng = np.random.default_rng(0)
    # in a degree
    hours = np.arange(13) / 6
    metres = np.array([55_800, 111_400])
    velocity = rng.normal((900, 0), 200, (8000, 1, 2))
    away = rng.normal(0, 500, velocity.shape) + velocity * hours[:, None]
    ashore = away[..., 0] > 2500
    away[ashore & np.roll(ashore, 1, axis=1)] = np.nan
    units = "hours since 2026-01-01 12:00"
    write(path, (4.8, 60.0) + away / metres, hours, status=ashore, units=units)


def skip_without(package: str) -> None:
    if importlib.util.find_spec(package) is None:  # importing it could be slow
        pytest.skip(f"{package} is not installed")


@pytest.mark.parametrize("page", PAGES_WITH_LINKS, ids=path_of)
def test_links_and_images_exist(page):
    text = re.sub(r"^```(?!\{).*?^```$", "", page.read_text("utf-8"), flags=re.M | re.S)
    targets = re.findall(r"\]\(([^)\s]+)\)", text) + re.findall(r'src(?:set)?="([^"]+)"', text)
    for target in targets:
        if target.startswith(("https://", "mailto:", "../../actions/")):  # the last one on GitHub
            continue
        name, _, section = target.partition("#")
        path = page.parent / name if name else page
        if path.suffix in (".gif", ".png", ".svg") and (ROOT / "PKG-INFO").exists():
            continue  # an sdist does not contain images
        assert path.exists(), target
        if path.suffix == ".md":
            assert not section or section in anchors(path), target


def anchors(page: Path) -> list[str]:
    """The anchors of a page's headings, as GitHub forms them."""
    titles = re.findall(r"^#+ (.+)$", page.read_text("utf-8"), re.M)
    return [re.sub(r"[^\w\- ]", "", title).lower().replace(" ", "-") for title in titles]


class Command(NamedTuple):
    """A command on a page: `python` with these arguments."""

    page: str
    arguments: list[str]

    @property
    def script(self) -> str:
        """The script that it runs, or an empty string."""
        return self.arguments[0] if self.arguments[0].endswith(".py") else ""

    @property
    def is_slow(self) -> bool:
        """Whether it may take minutes, or needs a file that is missing."""
        if any("runs/" in argument for argument in self.arguments):  # the result of a training
            return True
        subcommand = "".join(self.arguments[2:3]) if self.arguments[0] == "-m" else ""
        if subcommand == "leaderboard":  # draws many pictures; test_leaderboard.py runs it
            return True
        return self.page.startswith(SLOW_PAGES) and subcommand not in QUICK_COMMANDS


def commands() -> list[Command]:
    """The commands that run the package or a script; not those that install or test."""
    found = []
    for block in blocks("sh"):
        page = block.name.rsplit("-", 1)[0]
        for line in block.text.splitlines():
            program, *arguments = shlex.split(line, comments=True) or [""]
            if program == "droneswarmsearch":
                program = "python"
                arguments = ["-m", "DroneSwarmSearch", *arguments]
            ours = arguments[:2] == ["-m", "DroneSwarmSearch"] or arguments[:1] != ["-m"]
            if program == "python" and arguments and "&&" not in arguments and ours:
                found.append(Command(page, arguments))
    return found


def command_params(slow: bool) -> list[object]:
    """Slow or quick commands as test parameters, each once; Ray and MP4 videos are slow."""
    unique = {shlex.join(each.arguments): each for each in commands() if each.is_slow == slow}
    params: list[object] = []
    for text, each in unique.items():
        marks = [pytest.mark.slow] * ("--ray" in text or ".mp4" in text)
        needs = "-needs-rllib" * ("--ray" in text)
        params.append(pytest.param(each, id=f"{each.page}: {text}{needs}", marks=marks))
    return params


@functools.cache
def help_text(*start: str) -> str:
    with pytest.MonkeyPatch.context() as patch:
        return run_here([*start, "--help"], ROOT, patch)


@pytest.mark.parametrize("command", command_params(slow=True))
def test_slow_commands_use_existing_options(command):
    """Only the options are checked; other tests run the training scripts."""
    options = [argument for argument in command.arguments if argument.startswith("--")]
    known = ""
    if command.script.startswith("examples/train_"):  # its RL library may not be installed
        script = (ROOT / command.script).read_text("utf-8")
        known = script + (ROOT / "examples/training_script.py").read_text("utf-8")
        known += "".join(
            f"--{name.replace('_', '-')}\n" for name in re.findall(r"(\w+)=\{", script)
        )
    elif options:
        start = command.arguments[:1] if command.script else command.arguments[:3]
        known = help_text(*start)
    assert not command.script or (ROOT / command.script).exists()
    assert [option for option in options if not re.search(rf"{option}\b", known)] == []


@pytest.fixture(scope="module")
def first_plan(tmp_path_factory):
    """The folder of the first plan on a page, with which later ones begin."""
    folder = tmp_path_factory.mktemp("first")
    first = next(each.arguments for each in commands() if "--position" in each.arguments)
    with pytest.MonkeyPatch.context() as patch:
        run_here([*first, "--no-alternatives"], folder, patch)
    return folder / "plan"


@pytest.mark.thorough
@pytest.mark.filterwarnings("default")
@pytest.mark.parametrize("command", command_params(slow=False))
@pytest.mark.usefixtures("brief_plans")
def test_command(command, first_plan, tmp_path, monkeypatch):
    """Every command runs, with few episodes or steps, in a folder with the scripts of a clone."""
    arguments = list(command.arguments)
    if "--ray" in command.arguments:
        skip_without("ray")
    elif command.script == "examples/random_searches.py":
        arguments += ["--seed", "11"]  # a small search
    elif arguments[2:3] == ["plan"] and arguments[-1] != "plan":
        arguments.append("--no-alternatives")
    for option, most in MOST.items():
        if option in arguments:
            place = arguments.index(option) + 1
            arguments[place] = str(min(int(arguments[place]), most))
    shutil.copytree(ROOT / "examples", tmp_path / "examples")
    shutil.copy(ROOT / "basic_env.py", tmp_path)
    if "--after" in arguments:
        shutil.copytree(first_plan, tmp_path / "plan")
    for name, text in fleets().items():
        (tmp_path / name).write_text(text, "utf-8")
    if "--ray" in command.arguments or "--workers" in arguments:
        printed = run_python(arguments, tmp_path)
    else:
        printed = run_here(arguments, tmp_path, monkeypatch)
    assert printed.strip()
    assert OUTPUT.get(command.script, "") in printed
    for option, argument in itertools.pairwise(arguments):
        if option in ("--out", "--record", "--csv"):
            assert (tmp_path / argument).exists() or argument.startswith("-")


@pytest.mark.thorough
@pytest.mark.parametrize(
    ("script", "shown"),
    [
        (["examples/vector_rollout.py", "--num-envs", "8", "--steps", "20"], "steps per second"),
        (["examples/prior_or_posterior.py", "--episodes", "2"], "posterior: found in"),
        (["examples/finds_that_teach.py", "--episodes", "1"], "the drift is known"),
        (["benchmarks/bench_step.py", *BENCH_BRIEFLY.split()], "idle/floor"),
    ],
    ids=["vector_rollout", "prior_or_posterior", "finds_that_teach", "bench_step"],
)
def test_scripts_without_a_command_on_a_page(script, shown, monkeypatch):
    assert shown in run_here(script, ROOT, monkeypatch)


def run_here(arguments: list[str], folder: Path, patch: pytest.MonkeyPatch) -> str:
    """Do what `python` does with some arguments, faster in this process; return the output."""
    hide_the_display(patch)
    patch.chdir(folder)
    code: object = 0
    with contextlib.redirect_stdout(io.StringIO()) as output:
        try:
            if arguments[0] == "-m":
                assert arguments[1] == "DroneSwarmSearch"
                code = cli.main(arguments[2:])
            else:
                patch.setattr(sys, "argv", arguments)
                patch.syspath_prepend(str((folder / arguments[0]).parent))
                runpy.run_path(str(folder / arguments[0]), run_name="__main__")
        except SystemExit as stop:
            code = stop.code
    assert not code
    return output.getvalue()


def hide_the_display(patch: pytest.MonkeyPatch) -> None:
    """Let drawings go to files only, and videos show two frames."""
    few_pictures(patch)
    patch.delenv("DISPLAY", raising=False)
    patch.setenv("MPLBACKEND", "Agg")
    if sys.platform in ("darwin", "win32"):  # they always have a display
        patch.setenv("SDL_VIDEODRIVER", "none_such")
    else:
        patch.delenv("SDL_VIDEODRIVER", raising=False)


def run_python(arguments: list[str], folder: Path, timeout: float = TIMEOUT) -> str:
    """Run Python in a folder, without a display, and return its output."""
    with pytest.MonkeyPatch.context() as patch:
        hide_the_display(patch)
        environment = {**os.environ, "PYTHONPATH": str(ROOT), "PYTHONUTF8": "1", **QUIET_RAY}
    how = {"cwd": folder, "env": environment, "timeout": timeout, "encoding": "utf-8"}
    command = [sys.executable, *arguments]
    stdin = subprocess.DEVNULL
    run = subprocess.run(command, stdin=stdin, capture_output=True, check=False, **how)
    assert run.returncode == 0, run.stderr
    return run.stdout
