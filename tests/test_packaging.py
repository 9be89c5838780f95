"""The contents of the wheel and the sdist, and installation in every form."""

import importlib.util
import json
import os
import re
import subprocess
import sys
import tarfile
import venv
import zipfile
from pathlib import Path, PurePosixPath

import pytest

import DroneSwarmSearch

CHECKOUT = Path(__file__).resolve().parent.parent
PACKAGES = ("DroneSwarmSearch", "DroneSwarmSearchEnvironment")
NAME = f"droneswarmsearchenvironment-{DroneSwarmSearch.__version__}"
MEGABYTE = 10**6
BUILDERS = ("build", "editables", "hatch_fancy_pypi_readme", "hatchling", "pip")
PICTURES = (".gif", ".png", ".svg")
"""Not in the sdist, to keep it small."""

pytestmark = [
    pytest.mark.skipif(
        not (CHECKOUT / "DroneSwarmSearch").exists(), reason="there is no source tree to build"
    ),
    pytest.mark.skipif(
        not all(map(importlib.util.find_spec, BUILDERS)), reason=f"{', '.join(BUILDERS)} are needed"
    ),
]

# Prints where the package is, and whether the three import forms agree.
PROBE = """
import importlib, json, sys
names = ("DroneSwarmSearch", "DroneSwarmSearch.env", "DroneSwarmSearchEnvironment.env")
modules = [importlib.import_module(name) for name in names]
classes = {id(module.DroneSwarmSearch) for module in modules}
env = modules[0].DroneSwarmSearch()
env.reset(seed=1)
env.step({"drone0": 4})
from importlib.metadata import version
print(json.dumps({
    "files": [module.__file__ for module in modules],
    "classes": len(classes),
    "version": version("DroneSwarmSearchEnvironment"),
    "frame": env.render(),
}))
"""


def run(*command: object, cwd: Path) -> str:
    """Run a command without the checkout on its path; returns its output."""
    clean = {key: value for key, value in os.environ.items() if not key.startswith("PYTHON")}
    done = subprocess.run(
        [str(part) for part in command],
        cwd=cwd,
        env={**clean, "PIP_DISABLE_PIP_VERSION_CHECK": "1"},
        capture_output=True,
        text=True,
        timeout=300,
        check=False,
    )
    assert done.returncode == 0, done.stdout + done.stderr
    return done.stdout


@pytest.fixture(scope="module")
def built(tmp_path_factory):
    """A folder with the sdist, and the wheel built from the sdist."""
    folder = tmp_path_factory.mktemp("built")
    run(sys.executable, "-m", "build", "--no-isolation", "-o", folder, CHECKOUT, cwd=folder)
    assert sorted(path.name for path in folder.iterdir()) == [
        f"{NAME}-py3-none-any.whl",
        f"{NAME}.tar.gz",
    ]
    return folder


def dependencies() -> set[str]:
    """Return the folders of the dependencies in the running environment."""
    specs = map(importlib.util.find_spec, ("gymnasium", "pettingzoo", *BUILDERS))
    return {str(Path(spec.origin).parent.parent) for spec in specs if spec and spec.origin}


def sources() -> set[str]:
    """The packages' own files in the checkout."""
    return {
        path.relative_to(CHECKOUT).as_posix()
        for package in PACKAGES
        for path in (CHECKOUT / package).rglob("*")
        if path.is_file() and "__pycache__" not in path.parts
    }


def tracked(*folders: str) -> set[str]:
    """Return the files in some folders that Git tracks or does not ignore."""
    git = ("git", "ls-files", "--cached", "--others", "--exclude-standard", *folders)
    if not (CHECKOUT / ".git").exists():
        pytest.skip("this is no Git checkout")
    files = run(*git, cwd=CHECKOUT).splitlines()
    return {file for file in files if (CHECKOUT / file).exists()}


@pytest.mark.thorough
def test_the_wheel_contains_only_the_packages(built):
    path = built / f"{NAME}-py3-none-any.whl"
    assert path.stat().st_size < 6 * MEGABYTE  # mostly tracks of the suite
    with zipfile.ZipFile(path) as wheel:
        held = set(wheel.namelist())
    info = {
        f"{NAME}.dist-info/{file}" for file in ("METADATA", "WHEEL", "RECORD", "entry_points.txt")
    }
    assert held == sources() | info | {f"{NAME}.dist-info/licenses/LICENSE"}
    assert {f"{package}/py.typed" for package in PACKAGES} <= held


def test_the_sdist_contains_the_sources_and_the_tests(built):
    path = built / f"{NAME}.tar.gz"
    assert path.stat().st_size < 7 * MEGABYTE
    with tarfile.open(path) as sdist:
        names = [PurePosixPath(member.name) for member in sdist.getmembers() if member.isfile()]
    held = {name.relative_to(NAME).as_posix() for name in names}
    assert sources() | {"LICENSE", "README.md", "basic_env.py", "pyproject.toml"} <= held
    # All tests, examples and documentation except pictures and episodes.
    assert {file for file in held if file.startswith(("docs/", "examples/", "tests/"))} == {
        path
        for path in tracked("docs", "examples", "tests")
        if Path(path).suffix not in PICTURES and not path.startswith("docs/static/episodes/")
    }


def test_the_description_is_the_readme_with_links_to_the_tag(built):
    with zipfile.ZipFile(built / f"{NAME}-py3-none-any.whl") as wheel:
        metadata = wheel.read(f"{NAME}.dist-info/METADATA").decode()
    headers, description = metadata.split("\n\n", 1)
    address = dict(re.findall("^Project-URL: (.+), (.+)$", headers, re.M))
    tag = f"v{DroneSwarmSearch.__version__}"

    def absolute(match: re.Match[str]) -> str:
        before, link = match.groups()
        if link.startswith("../../"):
            return f"{before}{address['Repository']}/{link[6:]}"
        kind = "raw" if link.endswith(PICTURES) else "blob"
        return f"{before}{address['Repository']}/{kind}/{tag}/{link}"

    relative = r'(\]\(|\b(?:src|srcset|href)=")(?!https:|#)([^)"]+)'
    readme = (CHECKOUT / "README.md").read_text("utf-8")
    parts = re.split("(^```.*?^```$)", readme, flags=re.M | re.S)  # every second one is code
    parts[::2] = [re.sub(relative, absolute, part) for part in parts[::2]]
    assert description == "".join(parts)


@pytest.mark.thorough
@pytest.mark.parametrize(
    "what",
    ["wheel", *(pytest.param(what, marks=pytest.mark.slow) for what in ("sdist", "editable"))],
)
def test_installed(what, built, tmp_path):
    """Install into a new environment that can import the current one's dependencies."""
    home = tmp_path / "environment"
    builder = venv.EnvBuilder(with_pip=False)
    builder.create(home)
    python = builder.ensure_directories(home).env_exe
    purelib = "import sysconfig; print(sysconfig.get_path('purelib'))"
    own = Path(run(python, "-c", purelib, cwd=tmp_path).strip())
    # The last .pth file by name, so that packages installed here come first on the path.
    (own / "zz_dependencies.pth").write_text("\n".join(dependencies()), encoding="utf-8")
    source = {
        "wheel": [built / f"{NAME}-py3-none-any.whl"],
        "sdist": [built / f"{NAME}.tar.gz"],
        "editable": ["--editable", CHECKOUT],
    }[what]
    offline = ("--no-deps", "--no-index", "--no-build-isolation", "--ignore-installed")
    pip = (sys.executable, "-m", "pip", "--python", python)
    run(*pip, "install", "--quiet", *offline, *source, cwd=tmp_path)

    result = json.loads(run(python, "-c", PROBE, cwd=tmp_path))
    assert result["classes"] == 1
    assert result["version"] == DroneSwarmSearch.__version__
    assert result["frame"].startswith("step 1/100")
    expected = CHECKOUT if what == "editable" else own
    for file in result["files"]:
        assert Path(file).resolve().is_relative_to(expected.resolve())
    assert list(own.glob("droneswarmsearchenvironment-*.dist-info"))
