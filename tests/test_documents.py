"""What the README, the docs and the examples show runs as it stands there."""

from __future__ import annotations

import contextlib
import io
import os
import re
import shlex
import shutil
import subprocess
import sys
from pathlib import Path

import pytest

ROOT = Path(__file__).parents[1]
PAGES = [ROOT / "README.md", *sorted((ROOT / "docs").rglob("*.md"))]
GUIDES = ("README.md", "evaluation.md", "policies.md")
"""The pages whose commands take seconds and need nothing that is not installed."""


def blocks(language: str) -> list[tuple[str, str]]:
    """The code blocks of a language in all pages, with a name for each."""
    return [
        (f"{page.name}-{number}", block)
        for page in PAGES
        for number, block in enumerate(
            re.findall(rf"^```{language}\n(.*?)^```", page.read_text("utf-8"), re.M | re.S)
        )
    ]


@pytest.mark.parametrize("block", [pytest.param(text, id=name) for name, text in blocks("python")])
def test_python_block(block: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.chdir(tmp_path)
    for trainer in ("stable_baselines3", "torch"):  # extras, or nothing of ours
        if re.search(rf"^(from|import) {trainer}\b", block, re.M):
            pytest.importorskip(trainer)
    with contextlib.redirect_stdout(io.StringIO()) as output:
        exec(compile(block, "block", "exec"), {"__name__": "__main__"})
    assert output.getvalue().strip()


def test_the_readme_search_succeeds() -> None:
    first = next(text for name, text in blocks("python") if name.startswith("README"))
    with contextlib.redirect_stdout(io.StringIO()) as output:
        exec(compile(first, "block", "exec"), {"__name__": "__main__"})
    assert "found: True" in output.getvalue()


def test_the_readme_has_the_two_commands_that_ci_runs() -> None:
    texts = [text.strip() for name, text in blocks("sh") if name.startswith("README")]
    commands = [text for text in texts if " pip install " in text]
    assert [command.split("&&")[1].strip() for command in commands] == [
        "python basic_env.py",
        "python -m pytest -n auto",
    ]
    assert all(command.startswith("python -m pip install ") for command in commands)


@pytest.mark.parametrize("page", PAGES, ids=lambda page: page.name)
def test_links_and_pictures_exist(page: Path) -> None:
    text = page.read_text("utf-8")
    targets = re.findall(r"\]\(([^)\s]+)\)", text) + re.findall(r'src="([^"]+)"', text)
    for target in targets:
        if target.startswith("https://"):
            continue
        name, _, section = target.partition("#")
        there = page.parent / name if name else page
        assert there.exists(), target
        assert not section or section in sections(there), target


def sections(page: Path) -> list[str]:
    """The names of a page's sections in links, as GitHub forms them."""
    titles = re.findall(r"^#+ (.+)$", page.read_text("utf-8"), re.M)
    return [re.sub(r"[^\w\- ]", "", title).lower().replace(" ", "-") for title in titles]


TRAINING = re.findall(
    r"^python (examples/train_\w+\.py) (.*)$",
    (ROOT / "docs" / "training.md").read_text("utf-8"),
    re.M,
)


@pytest.mark.parametrize(("script", "arguments"), TRAINING)
def test_training_commands_have_options_that_there_are(script: str, arguments: str) -> None:
    """They are run, shortly, in the tests of the examples."""
    text = (ROOT / script).read_text("utf-8")
    text += (ROOT / "DroneSwarmSearch" / "training" / "options.py").read_text("utf-8")
    given = [word for word in shlex.split(arguments) if word.startswith("--")]
    assert given
    for option in given:
        assert f'"{option}"' in text, option


def commands() -> list[str]:
    """The commands of the guides, but for those that install something."""
    lines = []
    for name, text in blocks("sh"):
        page = name.rsplit("-", 1)[0]
        for line in text.splitlines():
            quick = page == "training.md" and line.startswith("python -m DroneSwarmSearch ")
            lines += [line] if page in GUIDES or quick else []
    return [line for line in lines if " pip install " not in line]


@pytest.mark.parametrize("command", commands())
def test_command(command: str, tmp_path: Path) -> None:
    """Each is run where files may be written, with the examples at hand as in a clone."""
    shutil.copytree(ROOT / "examples", tmp_path / "examples")
    program, *arguments = shlex.split(command)
    assert program == "python"
    shown = run_python(arguments, tmp_path)
    assert shown.strip()
    for place, argument in enumerate(arguments):
        if argument == "--out":
            assert (tmp_path / arguments[place + 1]).exists()


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


def run_python(arguments: list[str], folder: Path) -> str:
    """What Python prints in a folder, where there is no display."""
    without_display = {
        name: value
        for name, value in os.environ.items()
        if name not in ("DISPLAY", "SDL_VIDEODRIVER")
    }
    run = subprocess.run(
        [sys.executable, *arguments],
        cwd=folder,
        env={**without_display, "PYTHONPATH": str(ROOT)},
        capture_output=True,
        text=True,
        timeout=120,
        check=False,
    )
    assert run.returncode == 0, run.stderr
    return run.stdout
