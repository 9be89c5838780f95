"""The documentation as a reader meets it: built strictly, then read in a browser.

The build needs the extra "docs", all of it "dev"; the browser is a Chromium or Chrome with its
ChromeDriver, steered by Selenium. Where one of them is missing, what needs it is skipped.

    python -m pytest -m slow tests/test_site.py
"""

from __future__ import annotations

import functools
import http.server
import os
import shutil
import subprocess
import sys
import threading
import urllib.parse
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import pytest

pytest.importorskip("sphinx", reason="the extra docs is not installed")
bs4 = pytest.importorskip("bs4")  # Furo brings it

ROOT = Path(__file__).parents[1]

pytestmark = [pytest.mark.slow, pytest.mark.pictures]

PHONE, SCREEN = 390, 1280

BROWSER = [
    "--headless=new",
    "--no-sandbox",  # containers run as root
    "--disable-gpu",
    "--disable-dev-shm-usage",
    "--no-first-run",
    "--disable-background-networking",
    "--disable-component-update",
    "--disable-sync",
]


SEEN = """
const style = element => getComputedStyle(element);
return {
    width: document.documentElement.scrollWidth,
    ground: style(document.body).backgroundColor.match(/\\d+/g).slice(0, 3).map(Number),
    pictures: [...document.querySelectorAll("article img")].map(image => [
        [...image.classList], style(image).display !== "none", image.naturalWidth > 0,
    ]),
};
"""
"""What is asked of a page in a browser, in one go."""


@pytest.fixture(scope="session")
def site(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """The site, built by the command that contributors use: a warning is an error."""
    out = tmp_path_factory.mktemp("site")
    command = [sys.executable, "-m", "sphinx", "-q", "-W", "--keep-going", "docs", str(out)]
    built = subprocess.run(
        [*command, "-d", str(tmp_path_factory.mktemp("doctrees"))],
        cwd=ROOT,
        capture_output=True,
        text=True,
        check=False,
    )
    assert built.returncode == 0, built.stderr
    return out


@pytest.fixture(scope="session")
def pages(site: Path) -> dict[Path, Any]:
    """Every page by its file, parsed."""
    return {
        path: bs4.BeautifulSoup(path.read_text("utf-8"), "html.parser")
        for path in sorted(site.rglob("*.html"))
    }


def is_elsewhere(address: str) -> bool:
    """Whether it leads out of the site."""
    return bool(urllib.parse.urlsplit(address).scheme)


def test_every_source_is_a_page(site: Path) -> None:
    sources = [*ROOT.glob("docs/**/*.md"), *ROOT.glob("docs/**/*.rst")]
    assert len(sources) > 20
    for source in sources:
        page = site / source.relative_to(ROOT / "docs").with_suffix(".html")
        assert page.exists(), page


def test_every_internal_link_leads_somewhere(pages: dict[Path, Any]) -> None:
    names = {path: {tag["id"] for tag in page.find_all(id=True)} for path, page in pages.items()}
    followed = 0
    for path, page in pages.items():
        for tag in page.find_all(["a", "link", "img", "script", "source"]):
            address = tag.get("href") or tag.get("src")
            if not address or is_elsewhere(address):
                continue
            followed += 1
            parts = urllib.parse.urlsplit(urllib.parse.unquote(address))
            there = (path.parent / parts.path).resolve() if parts.path else path
            assert there.is_file(), f"{path}: {address}"
            if parts.fragment and there in names:
                assert parts.fragment in names[there], f"{path}: {address}"
    assert followed > 1000


def test_nothing_is_fetched_from_elsewhere(pages: dict[Path, Any]) -> None:
    for path, page in pages.items():
        for tag in page.find_all(["link", "img", "script", "source", "iframe"]):
            for address in (tag.get("src"), tag.get("href")):
                assert not address or not is_elsewhere(address), f"{path}: {address}"


def test_every_picture_tells_what_it_shows(pages: dict[Path, Any]) -> None:
    pictures = [
        (path, tag) for path, page in pages.items() for tag in page.select("article img[src]")
    ]
    assert len(pictures) > 10
    for path, tag in pictures:
        assert len(tag.get("alt", "")) > 20, f"{path}: {tag}"


def test_figures_have_a_form_for_each_theme(pages: dict[Path, Any]) -> None:
    drawn = [tag for page in pages.values() for tag in page.select("img.only-light")]
    assert drawn
    for tag in drawn:
        dark = tag.find_next_sibling("img")
        assert dark["src"] == tag["src"].replace("-light", "-dark")
        assert "only-dark" in dark["class"]


def test_no_picture_is_large(site: Path) -> None:
    for path in site.rglob("*"):
        if path.suffix in (".png", ".gif", ".svg", ".jpg"):
            assert path.stat().st_size < 1_000_000, path


@pytest.fixture(scope="session")
def address(site: Path) -> Iterator[str]:
    """Where the site is served."""

    class Quiet(http.server.SimpleHTTPRequestHandler):
        def log_message(self, *_: object) -> None:
            pass

    handler = functools.partial(Quiet, directory=str(site))
    server = http.server.ThreadingHTTPServer(("127.0.0.1", 0), handler)
    threading.Thread(target=server.serve_forever, daemon=True).start()
    yield f"http://127.0.0.1:{server.server_port}"
    server.shutdown()
    server.server_close()


@pytest.fixture(scope="session")
def browser(tmp_path_factory: pytest.TempPathFactory) -> Iterator[Any]:
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


def look(browser: Any, address: str, theme: str = "light", width: int = SCREEN) -> None:
    """Open a page as a reader with this theme and this width sees it."""
    browser.execute_cdp_cmd(
        "Emulation.setDeviceMetricsOverride",
        {"width": width, "height": 900, "deviceScaleFactor": 1, "mobile": width == PHONE},
    )
    browser.execute_cdp_cmd(
        "Emulation.setEmulatedMedia",
        {"features": [{"name": "prefers-color-scheme", "value": theme}]},
    )
    browser.get(address)


def complaints(browser: Any) -> list[str]:
    """What the console has got since it was last asked."""
    return [f"{entry['level']}: {entry['message']}" for entry in browser.get_log("browser")]


@pytest.mark.parametrize("width", [PHONE, SCREEN])
@pytest.mark.parametrize("theme", ["light", "dark"])
def test_in_a_browser(
    browser: Any, address: str, site: Path, pages: dict[Path, Any], theme: str, width: int
) -> None:
    """No page has an error, is wider than the window, or shows a picture of the other theme."""
    for page in pages:
        name = page.relative_to(site).as_posix()
        look(browser, f"{address}/{name}", theme, width)
        assert complaints(browser) == [], name
        seen = browser.execute_script(SEEN)
        assert seen["width"] <= width, name
        assert (max(seen["ground"]) < 64) == (theme == "dark"), name
        for classes, shown, loaded in seen["pictures"]:
            other = "only-light" if theme == "dark" else "only-dark"
            assert shown == (other not in classes) and (loaded or not shown), name


@pytest.mark.parametrize("served", [True, False], ids=["served", "from files"])
def test_search(browser: Any, address: str, site: Path, served: bool) -> None:
    """Words that readers look for lead to pages, on a server and on a disk alike."""
    from selenium.webdriver.support.wait import WebDriverWait

    root = address if served else site.as_uri()
    for words in ("posterior", "SwarmVectorEnv", "person_initial_position"):
        look(browser, f"{root}/search.html?q={words}")
        WebDriverWait(browser, 20).until(
            lambda chrome: chrome.find_elements("css selector", "#search-results li a")
        )
        first = browser.find_element("css selector", "#search-results li a")
        browser.get(first.get_attribute("href").split("#")[0])
        assert words.lower() in browser.find_element("css selector", "article").text.lower()
    errors = complaints(browser)
    assert not served or errors == []


def test_the_theme_can_be_chosen(browser: Any, address: str) -> None:
    look(browser, f"{address}/index.html")
    browser.execute_script("localStorage.clear()")
    seen = set()
    for _ in range(3):
        browser.execute_script("document.querySelector('.theme-toggle').click()")
        seen.add(browser.execute_script("return document.body.dataset.theme"))
    assert seen == {"light", "dark", "auto"}
    browser.execute_script("localStorage.clear()")
