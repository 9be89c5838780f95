"""The version, the environment's id, the repository's address, and the release."""

import re
import subprocess
from pathlib import Path

import pytest
from helpers import module_at

import DroneSwarmSearch as package
from DroneSwarmSearch import DroneSwarmSearch
from DroneSwarmSearch.vector import DroneVectorEnv, SwarmVectorEnv

ROOT = Path(__file__).parents[1]
VERSION = package.__version__
ID = "drone_swarm_search_v0"


def text_of(name: str) -> str:
    return (ROOT / name).read_text("utf-8")


def test_the_version_is_the_same_everywhere():
    assert re.fullmatch(r"\d+\.\d+\.\d+", VERSION)
    citation, readme, changelog = map(text_of, ("CITATION.cff", "README.md", "CHANGELOG.md"))
    assert re.findall(r"^version: (.+)$", citation, re.M) == [VERSION]
    assert re.findall(r"^ +version += \{(.+)\},$", readme, re.M) == [VERSION]
    titles = re.findall(r"^## (.+)$", changelog, re.M)
    assert re.fullmatch(rf"{re.escape(VERSION)} \((unreleased|\d{{4}}-\d\d-\d\d)\)", titles[0])
    assert all(re.fullmatch(r"\d+\.\d+\.\d+ \(\d{4}-\d\d-\d\d\)", title) for title in titles[1:])


def test_the_id_is_the_same_everywhere():
    for environment in (DroneSwarmSearch, DroneVectorEnv, SwarmVectorEnv):
        assert environment.metadata["name"] == ID
    folder = Path(package.__file__).parent
    assert [path.stem for path in folder.glob("drone_swarm_search_v*.py")] == [ID]


def test_the_address_is_in_one_file():
    pattern = r"(github\.com/[A-Za-z0-9-]+|[A-Za-z0-9-]+\.github\.io)/DroneSwarmSearch"
    if not (ROOT / ".git").exists():
        pytest.skip("this is no Git checkout")
    search = ("git", "grep", "--untracked", "-I", "-l", "-E", pattern)
    done = subprocess.run(search, cwd=ROOT, capture_output=True, text=True, check=True)
    # The notebook, which is made from it, installs the package in Colab.
    assert done.stdout.split() == ["docs/tutorial.ipynb", "pyproject.toml"]


@pytest.fixture(scope="module")
def publish_check():
    path = ROOT / ".github" / "publish_check.py"
    if not path.exists():
        pytest.skip("the workflows are not here")
    return module_at(path)


FILES = {
    "DroneSwarmSearch/__init__.py": '"""Text."""\n\n__version__ = "1.2.3"\n',
    "DroneSwarmSearch/drone_swarm_search_v7.py": "",
    "CHANGELOG.md": "# Changelog\n\n## 1.2.3 (2027-01-31)\n\n## 1.2.2 (2026-12-01)\n",
    "CITATION.cff": 'version: 1.2.3\ndate-released: "2027-01-31"\n',
    "README.md": "@software{it,\n  year    = {2027},\n}\n",
    "docs/tutorial.ipynb": "git+https://github.com/me/it\n",
    "pyproject.toml": '# OWNER stands for me.\nRepository = "https://github.com/me/it"\n',
    "tests/golden/released.txt": "drone_swarm_search_v7 find 0a1b\n",
}


def test_only_what_is_open_is_listed_as_open(publish_check, tmp_path):
    for name, text in FILES.items():
        (tmp_path / name).parent.mkdir(parents=True, exist_ok=True)
        (tmp_path / name).write_text(text, encoding="utf-8")

    def still_open() -> str:
        done = publish_check.checks(tmp_path)
        return " ".join(item.split(":")[0] for item in done if not done[item])

    assert still_open() == "git"
    me = ("-c", "user.name=me", "-c", "user.email=me@it.example")
    for command in (["init"], [*me, "commit", "--allow-empty", "-m", "Start"], ["tag", "v1.2.3"]):
        subprocess.run(["git", *command], cwd=tmp_path, capture_output=True, check=True)
    assert still_open() == ""
    for name, old, new, items in [
        ("CHANGELOG.md", "2027-01-31", "unreleased", "CHANGELOG.md CITATION.cff README.md"),
        ("CITATION.cff", "date-released", "# date", "CITATION.cff"),
        ("README.md", "2027", "2026", "README.md"),
        ("docs/tutorial.ipynb", "me", "OWNER", "pyproject.toml"),
        ("pyproject.toml", "/me", "/OWNER", "pyproject.toml"),
        ("tests/golden/released.txt", "v7", "v6", "tests/golden/released.txt"),
    ]:
        (tmp_path / name).write_text(FILES[name].replace(old, new), encoding="utf-8")
        assert still_open() == items
        (tmp_path / name).write_text(FILES[name], encoding="utf-8")


def test_a_dated_version_only_needs_its_tag(publish_check):
    done = publish_check.checks()
    if re.search(r"^## .+ \(unreleased\)$", text_of("CHANGELOG.md"), re.M):
        assert "date-released" not in text_of("CITATION.cff")
    else:
        assert [item for item in done if not done[item] and not item.startswith("git:")] == []
