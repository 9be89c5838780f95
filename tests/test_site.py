"""The documentation builds without warnings and works in a browser.

The build needs the extra "docs"; the browser tests need Selenium (extra "dev") and Chromium or
Chrome with its ChromeDriver. Tests are skipped where something is missing.

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
bs4 = pytest.importorskip("bs4")  # installed with Furo

ROOT = Path(__file__).parents[1]

pytestmark = [pytest.mark.slow, pytest.mark.pictures]

PHONE, DESKTOP = 390, 1280
"""Window widths in pixels."""

BROWSER = [
    "--headless=new",
    "--no-sandbox",  # required for root, as in containers
    "--disable-gpu",
    "--disable-dev-shm-usage",
    "--no-first-run",
    "--disable-background-networking",
    "--disable-component-update",
    "--disable-sync",
]


INSPECT = """
const style = element => getComputedStyle(element);
return {
    width: document.documentElement.scrollWidth,
    background: style(document.body).backgroundColor.match(/\\d+/g).slice(0, 3).map(Number),
    images: [...document.querySelectorAll("article img")].map(image => [
        [...image.classList], style(image).display !== "none", image.naturalWidth > 0,
    ]),
};
"""
"""A script that returns a page's width, background colour and images."""


@pytest.fixture(scope="session")
def site(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """The folder of the built site; a warning fails the build."""
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
    """The parsed HTML of every page, by file."""
    return {
        path: bs4.BeautifulSoup(path.read_text("utf-8"), "html.parser")
        for path in sorted(site.rglob("*.html"))
    }


def is_external(address: str) -> bool:
    """Whether an address leads out of the site."""
    return bool(urllib.parse.urlsplit(address).scheme)


def test_every_source_has_a_page(site: Path) -> None:
    sources = [*ROOT.glob("docs/**/*.md"), *ROOT.glob("docs/**/*.rst")]
    assert len(sources) > 20
    for source in sources:
        page = site / source.relative_to(ROOT / "docs").with_suffix(".html")
        assert page.exists(), page


def test_internal_links_have_targets(pages: dict[Path, Any]) -> None:
    names = {path: {tag["id"] for tag in page.find_all(id=True)} for path, page in pages.items()}
    followed = 0
    for path, page in pages.items():
        for tag in page.find_all(["a", "link", "img", "script", "source"]):
            address = tag.get("href") or tag.get("src")
            if not address or is_external(address):
                continue
            followed += 1
            parts = urllib.parse.urlsplit(urllib.parse.unquote(address))
            target = (path.parent / parts.path).resolve() if parts.path else path
            assert target.is_file(), f"{path}: {address}"
            if parts.fragment and target in names:
                assert parts.fragment in names[target], f"{path}: {address}"
    assert followed > 1000


def test_pages_load_nothing_external(pages: dict[Path, Any]) -> None:
    for path, page in pages.items():
        for tag in page.find_all(["link", "img", "script", "source", "iframe"]):
            for address in (tag.get("src"), tag.get("href")):
                assert not address or not is_external(address), f"{path}: {address}"


def test_images_have_alternative_texts(pages: dict[Path, Any]) -> None:
    images = [
        (path, tag) for path, page in pages.items() for tag in page.select("article img[src]")
    ]
    assert len(images) > 10
    for path, tag in images:
        assert len(tag.get("alt", "")) > 20, f"{path}: {tag}"


def test_figures_have_a_light_and_a_dark_version(pages: dict[Path, Any]) -> None:
    figures = [tag for page in pages.values() for tag in page.select("img.only-light")]
    assert figures
    for tag in figures:
        dark = tag.find_next_sibling("img")
        assert dark["src"] == tag["src"].replace("-light", "-dark")
        assert "only-dark" in dark["class"]


def test_images_are_smaller_than_a_megabyte(site: Path) -> None:
    for path in site.rglob("*"):
        if path.suffix in (".png", ".gif", ".svg", ".jpg"):
            assert path.stat().st_size < 1_000_000, path


@pytest.fixture(scope="session")
def address(site: Path) -> Iterator[str]:
    """The address of a local server of the site."""

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


def open_page(browser: Any, address: str, theme: str = "light", width: int = DESKTOP) -> None:
    """Open a page with a theme and a window width."""
    browser.execute_cdp_cmd(
        "Emulation.setDeviceMetricsOverride",
        {"width": width, "height": 900, "deviceScaleFactor": 1, "mobile": width == PHONE},
    )
    browser.execute_cdp_cmd(
        "Emulation.setEmulatedMedia",
        {"features": [{"name": "prefers-color-scheme", "value": theme}]},
    )
    browser.get(address)


def console_messages(browser: Any) -> list[str]:
    """The messages on the console since the last call."""
    return [f"{entry['level']}: {entry['message']}" for entry in browser.get_log("browser")]


@pytest.mark.parametrize("width", [PHONE, DESKTOP])
@pytest.mark.parametrize("theme", ["light", "dark"])
def test_pages_in_a_browser(
    browser: Any, address: str, site: Path, pages: dict[Path, Any], theme: str, width: int
) -> None:
    """Pages have no errors, fit the window, and show the images of the chosen theme."""
    for page in pages:
        name = page.relative_to(site).as_posix()
        open_page(browser, f"{address}/{name}", theme, width)
        assert console_messages(browser) == [], name
        result = browser.execute_script(INSPECT)
        assert result["width"] <= width, name
        assert (max(result["background"]) < 64) == (theme == "dark"), name
        for classes, shown, loaded in result["images"]:
            other = "only-light" if theme == "dark" else "only-dark"
            assert shown == (other not in classes) and (loaded or not shown), name


@pytest.mark.parametrize("served", [True, False], ids=["served", "from files"])
def test_search(browser: Any, address: str, site: Path, served: bool) -> None:
    """The search finds pages, both on a server and from local files."""
    from selenium.webdriver.support.wait import WebDriverWait

    root = address if served else site.as_uri()
    for words in ("posterior", "SwarmVectorEnv", "person_initial_position"):
        open_page(browser, f"{root}/search.html?q={words}")
        WebDriverWait(browser, 20).until(
            lambda chrome: chrome.find_elements("css selector", "#search-results li a")
        )
        first = browser.find_element("css selector", "#search-results li a")
        browser.get(first.get_attribute("href").split("#")[0])
        assert words.lower() in browser.find_element("css selector", "article").text.lower()
    errors = console_messages(browser)
    assert not served or errors == []


def test_the_theme_can_be_chosen(browser: Any, address: str) -> None:
    open_page(browser, f"{address}/index.html")
    browser.execute_script("localStorage.clear()")
    themes = set()
    for _ in range(3):
        browser.execute_script("document.querySelector('.theme-toggle').click()")
        themes.add(browser.execute_script("return document.body.dataset.theme"))
    assert themes == {"light", "dark", "auto"}
    browser.execute_script("localStorage.clear()")
