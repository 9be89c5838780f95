"""The version, the environment's id, and the release workflow."""

from __future__ import annotations

import re
from pathlib import Path
from types import ModuleType

import pytest
from golden.regenerate import SCENARIOS, released
from helpers import module_at

import DroneSwarmSearch as package
from DroneSwarmSearch import DroneSwarmSearch
from DroneSwarmSearch.vector import DroneVectorEnv, SwarmVectorEnv

ROOT = Path(__file__).parents[1]
VERSION = package.__version__
ID = "drone_swarm_search_v0"


def text_of(name: str) -> str:
    return (ROOT / name).read_text("utf-8")


# The version.


def test_the_version_is_the_same_everywhere():
    assert re.fullmatch(r"\d+\.\d+\.\d+", VERSION)
    citation, readme, changelog = map(text_of, ("CITATION.cff", "README.md", "CHANGELOG.md"))
    assert re.findall(r"^version: (.+)$", citation, re.M) == [VERSION]
    assert re.findall(r"^ +version += \{(.+)\},$", readme, re.M) == [VERSION]
    titles = re.findall(r"^## (.+)$", changelog, re.M)
    assert re.fullmatch(rf"{re.escape(VERSION)} \((unreleased|\d{{4}}-\d\d-\d\d)\)", titles[0])
    assert all(re.fullmatch(r"\d+\.\d+\.\d+ \(\d{4}-\d\d-\d\d\)", title) for title in titles[1:])


def test_a_released_version_has_a_date_and_released_episodes():
    title = re.findall(r"^## (.+)$", text_of("CHANGELOG.md"), re.M)[0]
    dates = re.findall(r"^date-released: *(.+)$", text_of("CITATION.cff"), re.M)
    if title == f"{VERSION} (unreleased)":
        assert not dates
        return
    assert set(released()) == set(SCENARIOS), "python tests/golden/regenerate.py --release"
    assert not re.search("^.*https://.*OWNER", text_of("pyproject.toml"), re.M)
    (date,) = re.findall(r'^"(\d{4}-\d\d-\d\d)"$', "\n".join(dates), re.M)
    assert title == f"{VERSION} ({date})"
    assert f"year    = {{{date[:4]}}}" in text_of("README.md")


# The id.


def test_the_id_is_the_same_everywhere():
    for environment in (DroneSwarmSearch, DroneVectorEnv, SwarmVectorEnv):
        assert environment.metadata["name"] == ID
    folder = Path(package.__file__).parent
    assert [path.stem for path in folder.glob("drone_swarm_search_v*.py")] == [ID]


# The release workflow.


@pytest.fixture(scope="module")
def prepare() -> ModuleType:
    path = ROOT / ".github" / "prepare_release.py"
    if not path.exists():
        pytest.skip("the workflows are not here")
    return module_at(path)


README = """\
# Title
<img src="docs/a.gif" width="6"> <a href="docs/page.md">page</a> ![A (b)](docs/b.png)
<source media="(a: b)" srcset="docs/c.svg">
[page](docs/page.md#section) [here](#title) [there](https://example.org/x)
```python
d = {"a": [f](x)}
```
[![badge](c.svg)](LICENSE)
"""

AT = "https://git.example/me/it"
ABSOLUTE = f"""\
# Title
<img src="{AT}/raw/v1.2.3/docs/a.gif" width="6"> \
<a href="{AT}/blob/v1.2.3/docs/page.md">page</a> ![A (b)]({AT}/raw/v1.2.3/docs/b.png)
<source media="(a: b)" srcset="{AT}/raw/v1.2.3/docs/c.svg">
[page]({AT}/blob/v1.2.3/docs/page.md#section) [here](#title) [there](https://example.org/x)
```python
d = {{"a": [f](x)}}
```
[![badge]({AT}/raw/v1.2.3/c.svg)]({AT}/blob/v1.2.3/LICENSE)
"""
VARIABLES = {
    "GITHUB_REF_NAME": "v1.2.3",
    "GITHUB_REPOSITORY": "me/it",
    "GITHUB_SERVER_URL": "https://git.example",
}


@pytest.fixture
def checkout(tmp_path: Path) -> Path:
    for name, text in {
        "DroneSwarmSearch/__init__.py": '"""Text."""\n\n__version__ = "1.2.3"\n',
        "CHANGELOG.md": "# Changelog\n\n## 1.2.3 (2027-01-31)\n\n- New.\n",
        "README.md": README,
    }.items():
        (tmp_path / name).parent.mkdir(exist_ok=True)
        (tmp_path / name).write_text(text, encoding="utf-8")
    return tmp_path


def test_relative_links_of_the_readme_become_absolute(prepare, checkout):
    prepare.main(VARIABLES, checkout)
    assert (checkout / "README.md").read_text("utf-8") == ABSOLUTE
    prepare.main(VARIABLES, checkout)
    assert (checkout / "README.md").read_text("utf-8") == ABSOLUTE


@pytest.mark.parametrize(
    ("tag", "changelog", "why"),
    [
        ("v1.2.4", "## 1.2.3 (2027-01-31)\n", "the tag v1.2.4 does not match version 1.2.3"),
        ("v1.2.3", "## 1.2.3 (unreleased)\n", "no section '## 1.2.3 (YYYY-MM-DD)'"),
    ],
)
def test_an_unprepared_version_is_not_released(prepare, checkout, tag, changelog, why):
    (checkout / "CHANGELOG.md").write_text(changelog, encoding="utf-8")
    with pytest.raises(SystemExit, match=re.escape(why)):
        prepare.main({**VARIABLES, "GITHUB_REF_NAME": tag}, checkout)
    assert (checkout / "README.md").read_text("utf-8") == README
