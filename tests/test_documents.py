"""What the README, the docs and the examples show runs as it stands there."""

from __future__ import annotations

import contextlib
import importlib.util
import io
import itertools
import os
import re
import shlex
import shutil
import subprocess
import sys
from pathlib import Path
from typing import NamedTuple

import pytest
from trainer_examples import QUIET_RAY

from DroneSwarmSearch.training import options

ROOT = Path(__file__).parents[1]
DOCS = sorted((ROOT / "docs").rglob("*.md"))
PAGES = [ROOT / "README.md", *DOCS]
LINKING = [*sorted(ROOT.glob("*.md")), *DOCS]

EXTRAS = {
    **{name: name for name in ("agilerl", "benchmarl", "tianshou", "torchrl")},
    **dict.fromkeys(("sb3_contrib", "stable_baselines3", "supersuit"), "sb3"),
    "ray": "rllib",
    "torch": "ppo",  # which comes with most of the others
}
"""Packages that blocks may need and the package does not, by the extra that brings them."""

LONG = (
    *("docs/contributing.md", "docs/guides/training.md", "docs/guides/trainers/"),
    *("docs/leaderboard/", "docs/model.md", "docs/performance.md"),
)
"""The pages whose commands may take minutes, or need what is not installed."""

QUICK = ("bound", "evaluate", "play", "record")
"""The package's commands that take seconds on these pages, too."""

FENCE = re.compile(r"^```(?!`)(\S*)[^\n]*\n(.*?)^```$", re.M | re.S)

PATIENCE = 120.0
"""Seconds that a command may take; a trainer's block may take five times as long."""


def name_of(page: Path) -> str:
    """A page's path in the repository."""
    return page.relative_to(ROOT).as_posix()


class Block(NamedTuple):
    """A code block of a page.

    Attributes:
        name: the page and the block's number on it.
        text: the code.
        shown: what the page says that it prints; None if it does not say.
    """

    name: str
    text: str
    shown: str | None = None

    @property
    def trainers(self) -> list[str]:
        """The trainers that it needs."""
        wanted = {*re.findall(r"^(?:from|import) (\w+)", self.text, re.M)}
        wanted |= {"ray"} if re.search(r"\bray=", self.text) else set()
        return [package for package in EXTRAS if package in wanted]

    @property
    def case(self) -> str:
        """The test's name: `-k needs-torchrl` runs all blocks that need that extra."""
        return f"{self.name}-needs-{EXTRAS[self.trainers[0]]}" if self.trainers else self.name


def blocks(language: str) -> list[Block]:
    """The code blocks of a language in all pages."""
    found = []
    for page in PAGES:
        fences = list(FENCE.finditer(page.read_text("utf-8")))
        number = 0
        for fence, following in zip(fences, [*fences, None][1:], strict=True):
            if fence[1] != language:
                continue
            shown = following[2] if following is not None and following[1] == "text" else None
            if following is not None and re.search(r"^#", between(fence, following), re.M):
                shown = None  # of another section
            found.append(Block(f"{name_of(page)}-{number}", fence[2], shown))
            number += 1
    return found


def between(fence: re.Match[str], following: re.Match[str]) -> str:
    """The text from one fence to the next."""
    return fence.string[fence.end() : following.start()]


@pytest.mark.filterwarnings("default")
@pytest.mark.parametrize("block", [pytest.param(each, id=each.case) for each in blocks("python")])
def test_python_block(block: Block, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """It runs by itself, in an empty folder; where the page shows what it prints, it is that."""
    for trainer in block.trainers:
        skip_without(trainer)
    if block.trainers:  # in a process of its own, which takes with it whatever they leave
        printed = run_python(["-c", block.text], tmp_path, 5 * PATIENCE)
    else:
        monkeypatch.chdir(tmp_path)
        monkeypatch.delenv("DISPLAY", raising=False)
        monkeypatch.setenv("MPLBACKEND", "Agg")
        with contextlib.redirect_stdout(io.StringIO()) as output:
            exec(compile(block.text, block.name, "exec"), {"__name__": "__main__"})
        printed = output.getvalue()
    assert printed.strip()
    if block.shown is not None:
        assert printed.rstrip() == block.shown.rstrip()


def skip_without(trainer: str) -> None:
    """Skip the test where a trainer is not installed."""
    if importlib.util.find_spec(trainer) is None:  # importing it may take long, and warn
        pytest.skip(f"{trainer} is not installed")


def test_the_readme_search_succeeds() -> None:
    first = next(each.text for each in blocks("python") if each.name.startswith("README"))
    with contextlib.redirect_stdout(io.StringIO()) as output:
        exec(compile(first, "block", "exec"), {"__name__": "__main__"})
    assert "found: True" in output.getvalue()


def test_the_readme_has_the_two_commands_that_ci_runs() -> None:
    texts = [each.text.strip() for each in blocks("sh") if each.name.startswith("README")]
    commands = [text for text in texts if " pip install " in text and "&&" in text]
    assert [command.split("&&")[1].strip() for command in commands] == [
        "python basic_env.py",
        "python -m pytest -n auto",
    ]
    assert all(command.startswith("python -m pip install ") for command in commands)


@pytest.mark.parametrize("page", LINKING, ids=name_of)
def test_links_and_pictures_exist(page: Path) -> None:
    text = re.sub(r"^```(?!\{).*?^```$", "", page.read_text("utf-8"), flags=re.M | re.S)
    targets = re.findall(r"\]\(([^)\s]+)\)", text) + re.findall(r'src="([^"]+)"', text)
    for target in targets:
        if target.startswith(("https://", "mailto:")):
            continue
        name, _, section = target.partition("#")
        there = page.parent / name if name else page
        if there.suffix in (".gif", ".png", ".svg") and (ROOT / "PKG-INFO").exists():
            continue  # an unpacked sdist, which comes without the pictures
        assert there.exists(), target
        if there.suffix == ".md":
            assert not section or section in sections(there), target


def sections(page: Path) -> list[str]:
    """The names of a page's sections in links, as GitHub forms them."""
    titles = re.findall(r"^#+ (.+)$", page.read_text("utf-8"), re.M)
    return [re.sub(r"[^\w\- ]", "", title).lower().replace(" ", "-") for title in titles]


class Command(NamedTuple):
    """A command of a page: `python` and its arguments."""

    page: str
    arguments: list[str]

    @property
    def script(self) -> str:
        """The file that it runs, if it runs one."""
        return self.arguments[0] if self.arguments[0].endswith(".py") else ""

    @property
    def is_long(self) -> bool:
        """Whether it may take minutes, or needs what is not installed or not there."""
        if any("runs/" in argument for argument in self.arguments):  # which a training leaves
            return True
        quick = self.arguments[0] == "-m" and self.arguments[2:3] and self.arguments[2] in QUICK
        return self.page.startswith(LONG) and not quick


def commands() -> list[Command]:
    """The commands of the pages, but for those that install something, or test or open a window."""
    found = []
    for block in blocks("sh"):
        page = block.name.rsplit("-", 1)[0]
        for line in block.text.splitlines():
            program, *arguments = shlex.split(line, comments=True) or [""]
            ours = arguments[:2] == ["-m", "DroneSwarmSearch"] or arguments[:1][-1:] != ["-m"]
            if program == "python" and "&&" not in arguments and ours:
                found.append(Command(page, arguments))
    return found


def cases(long: bool) -> list[object]:
    """The commands that are run, or those of which the options are looked up; each once."""
    wanted = {shlex.join(each.arguments): each for each in commands() if each.is_long == long}
    return [
        pytest.param(each, id=f"{each.page}: {text}{'-needs-rllib' * ('--ray' in each.arguments)}")
        for text, each in wanted.items()
    ]


@pytest.mark.parametrize("command", cases(long=True))
def test_long_commands_have_options_that_there_are(command: Command) -> None:
    """Those of the training examples are run, shortly, in the tests of the examples."""
    if command.script:
        text = (ROOT / command.script).read_text("utf-8")
    else:
        text = re.sub(r"(--[\w-]+)", r'"\1"', run_python([*command.arguments[:3], "--help"], ROOT))
    if command.script.startswith("examples/train_"):
        text += Path(options.__file__).read_text("utf-8")
    for option in command.arguments:
        assert not option.startswith("--") or f'"{option}"' in text, option


@pytest.mark.parametrize("command", cases(long=False))
def test_command(command: Command, tmp_path: Path) -> None:
    """Each is run where files may be written, with the examples at hand as in a clone."""
    arguments = command.arguments
    if "--ray" in arguments:
        skip_without("ray")
    shutil.copytree(ROOT / "examples", tmp_path / "examples")
    shutil.copy(ROOT / "basic_env.py", tmp_path)
    shutil.copytree(ROOT / "tests" / "benchmarks", tmp_path / "tests" / "benchmarks")
    shown = run_python(arguments, tmp_path)
    assert shown.strip()
    for option, argument in itertools.pairwise(arguments):
        if option in ("--out", "--record", "--csv"):
            assert (tmp_path / argument).exists() or argument.startswith("-")


@pytest.mark.parametrize(
    ("script", "shows"),
    [
        (["basic_env.py", "--text"], "return"),
        (["-m", "DroneSwarmSearch"], "return"),
        (["examples/vector_rollout.py", "--num-envs", "8", "--steps", "20"], "steps per second"),
        (["examples/prior_or_posterior.py", "--episodes", "2"], "posterior: found in"),
        (["examples/evaluate_your_own.py", "--episodes", "20"], "greedy-posterior: found"),
        (
            [
                *("examples/random_searches.py", "--searches", "2", "--episodes", "20"),
                *("--policies", "ppo", "random"),
            ],
            "ppo ahead",
        ),
        (["tests/benchmarks/bench_step.py", "--rounds", "1", "--steps", "20"], "idle/floor"),
    ],
    ids=lambda value: value[0] if isinstance(value, list) else "",
)
def test_script(script: list[str], shows: str) -> None:
    assert shows in run_python(script, ROOT)


def run_python(arguments: list[str], folder: Path, patience: float = PATIENCE) -> str:
    """What Python prints in a folder, where there is no display."""
    without_display = {
        name: value
        for name, value in os.environ.items()
        if name not in ("DISPLAY", "SDL_VIDEODRIVER")
    }
    if sys.platform in ("darwin", "win32"):  # which always have a display
        without_display["SDL_VIDEODRIVER"] = "none_such"
    run = subprocess.run(
        [sys.executable, *arguments],
        cwd=folder,
        env={**without_display, "PYTHONPATH": str(ROOT), "PYTHONUTF8": "1", **QUIET_RAY},
        stdin=subprocess.DEVNULL,
        capture_output=True,
        encoding="utf-8",
        timeout=patience,
        check=False,
    )
    assert run.returncode == 0, run.stderr
    return run.stdout
