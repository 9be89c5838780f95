"""What the README, the docs and the examples show runs as it stands there."""

from __future__ import annotations

import contextlib
import io
import os
import re
import subprocess
import sys
from pathlib import Path

import pytest

ROOT = Path(__file__).parents[1]
PAGES = [ROOT / "README.md", *sorted((ROOT / "docs").rglob("*.md"))]


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
def test_python_block(block: str) -> None:
    for trainer in ("stable_baselines3",):  # an extra
        if f"from {trainer} " in block:
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
    commands = [text.strip() for name, text in blocks("sh") if name.startswith("README")]
    assert [command.split("&&")[1].strip() for command in commands] == [
        "python basic_env.py",
        "python -m pytest",
    ]
    assert all(command.startswith("python -m pip install ") for command in commands)


@pytest.mark.parametrize("page", PAGES, ids=lambda page: page.name)
def test_links_and_pictures_exist(page: Path) -> None:
    text = page.read_text("utf-8")
    targets = re.findall(r"\]\(([^)#\s]+)\)", text) + re.findall(r'src="([^"]+)"', text)
    for target in targets:
        assert target.startswith("https://") or (page.parent / target).exists(), target


@pytest.mark.parametrize(
    ("script", "shows"),
    [
        (["basic_env.py", "--text"], "return"),
        (["-m", "DroneSwarmSearch"], "return"),
        (["examples/vector_rollout.py", "--num-envs", "8", "--steps", "20"], "steps per second"),
        (["examples/prior_or_posterior.py", "--episodes", "2"], "posterior: found in"),
        (["tests/benchmarks/bench_step.py", "--rounds", "1", "--steps", "20"], "idle/floor"),
    ],
    ids=lambda value: value[0] if isinstance(value, list) else "",
)
def test_script(script: list[str], shows: str) -> None:
    without_display = {
        name: value
        for name, value in os.environ.items()
        if name not in ("DISPLAY", "SDL_VIDEODRIVER")
    }
    run = subprocess.run(
        [sys.executable, *script],
        cwd=ROOT,
        env={**without_display, "PYTHONPATH": str(ROOT)},
        capture_output=True,
        text=True,
        timeout=120,
        check=False,
    )
    assert run.returncode == 0, run.stderr
    assert shows in run.stdout
