"""Fixtures and hooks of all tests."""

import os
import shutil
import sys
import tempfile
from pathlib import Path

import pytest
from hypothesis import settings

# These hold assertions, too.
pytest.register_assert_rewrite("helpers", "random_persons", "twins")

# Tests run in parallel processes, whose BLAS threads would only compete. NumPy reads this once.
os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")

# A small coastline in place of 100 MB, here and in processes that tests start; its own cache.
SMALL_COAST = str(Path(__file__).parent / "small_coast")
sys.path.insert(0, SMALL_COAST)
os.environ["PYTHONPATH"] = os.pathsep.join([SMALL_COAST, os.environ.get("PYTHONPATH", "")])
CACHE = tempfile.TemporaryDirectory(prefix="droneswarmsearch-tests-")  # until the tests end
os.environ["XDG_CACHE_HOME"] = CACHE.name

from DroneSwarmSearch.incident import choice, planning
from DroneSwarmSearch.paths import joint_plan

# The same examples in each run; `--hypothesis-profile explore` draws others, and more of them.
settings.register_profile("same", deadline=None, derandomize=True)
settings.register_profile("explore", deadline=None, max_examples=1000)
settings.load_profile("same")

UNPACKED_SDIST = (Path(__file__).parents[1] / "PKG-INFO").exists()


@pytest.hookimpl(tryfirst=True)
def pytest_runtest_setup(item: pytest.Item) -> None:
    """Skip tests of pictures in an unpacked sdist, before their fixtures are made."""
    if UNPACKED_SDIST and item.get_closest_marker("pictures") is not None:
        pytest.skip("the sdist comes without pictures")


@pytest.fixture(scope="module")
def real_coast():
    """Let a module, and the programs that it starts, read the real coastline."""
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(sys, "path", [path for path in sys.path if path != SMALL_COAST])
        patch.setenv("PYTHONPATH", os.environ["PYTHONPATH"].replace(SMALL_COAST, ""))
        # Undone in reverse: whatever the module imports is forgotten.
        patch.setitem(sys.modules, "roaring_landmask", None)
        patch.delitem(sys.modules, "roaring_landmask")
        yield


QUICK = {
    (joint_plan, "ENOUGH"): 1,
    (joint_plan, "ENOUGH_NUDGES"): 1,
    (choice, "GENERATIONS"): 3,
    (planning, "MANY"): 2_000,
    (planning, "FIGURES"): 4_000,
}
GOOD = {
    (joint_plan, "ENOUGH"): 40,
    (joint_plan, "ENOUGH_NUDGES"): 10,
    (planning, "MANY"): planning.MANY,
    (planning, "FIGURES"): planning.FIGURES,
}
"""Little work of the planners, and work that suffices for small searches and exact figures."""


@pytest.fixture(autouse=True, scope="session")
def quick_plans():
    """Let the planners do little work."""
    with pytest.MonkeyPatch.context() as patch:
        for name, value in QUICK.items():
            patch.setattr(*name, value)
        yield


@pytest.fixture(autouse=True)
def good_plans(request, monkeypatch):
    """Let the planners do more work in tests of the quality of plans."""
    if request.node.get_closest_marker("good_plans") is not None:
        for name, value in GOOD.items():
            monkeypatch.setattr(*name, value)


# Without a sandbox, which is required for root, as in containers.
BROWSER = [
    "--headless=new",
    "--no-sandbox",
    "--disable-gpu",
    "--disable-dev-shm-usage",
    "--no-first-run",
    "--disable-background-networking",
    "--disable-component-update",
    "--disable-sync",
]


@pytest.fixture(scope="session")
def browser(tmp_path_factory):
    webdriver = pytest.importorskip("selenium.webdriver")
    binary = next(filter(None, map(shutil.which, ("chromium", "google-chrome", "chrome"))), None)
    driver = shutil.which("chromedriver") or os.path.join(
        os.environ.get("CHROMEWEBDRIVER", ""), "chromedriver"
    )
    if not binary or not os.path.exists(driver):
        pytest.skip("no Chromium with a ChromeDriver")
    options = webdriver.ChromeOptions()
    options.binary_location = binary
    for argument in (*BROWSER, f"--user-data-dir={tmp_path_factory.mktemp('profile')}"):
        options.add_argument(argument)
    options.set_capability("goog:loggingPrefs", {"browser": "ALL"})
    chrome = webdriver.Chrome(options=options, service=webdriver.ChromeService(driver))
    yield chrome
    chrome.quit()


@pytest.fixture
def dummy_display(monkeypatch):
    """Quit pygame, and select the dummy video driver."""
    pygame = pytest.importorskip("pygame")
    pygame.quit()
    monkeypatch.setenv("SDL_VIDEODRIVER", "dummy")
    yield
    pygame.quit()
