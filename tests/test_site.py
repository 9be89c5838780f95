"""The documentation builds without warnings and works in a browser.

The build needs the extra "docs"; the browser tests need Selenium (extra "dev") and Chromium or
Chrome with its ChromeDriver. Tests are skipped where something is missing.

    python -m pytest -m slow tests/test_site.py
"""

import functools
import http.server
import subprocess
import sys
import threading
import urllib.parse
from pathlib import Path
from typing import Any

import pytest

pytest.importorskip("sphinx", reason="the extra docs is not installed")
bs4 = pytest.importorskip("bs4")  # installed with Furo

ROOT = Path(__file__).parents[1]

pytestmark = [pytest.mark.slow, pytest.mark.pictures]

# window widths in pixels
PHONE = 390
DESKTOP = 1280

# A script that returns a page's width, background colour and images.
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


@pytest.fixture(scope="session")
def site(tmp_path_factory):
    """The folder of the built site; a warning fails the build."""
    out = tmp_path_factory.mktemp("site")
    command = [sys.executable, "-m", "sphinx", "-q", "-W", "--keep-going", "docs", str(out)]
    command += ["-d", str(tmp_path_factory.mktemp("doctrees"))]
    built = subprocess.run(command, cwd=ROOT, capture_output=True, text=True, check=False)
    assert built.returncode == 0, built.stderr
    return out


@pytest.fixture(scope="session")
def pages(site):
    """The parsed HTML of every page, by file."""
    return {
        path: bs4.BeautifulSoup(path.read_text("utf-8"), "html.parser")
        for path in sorted(site.rglob("*.html"))
    }


def test_every_source_has_a_page(site):
    sources = {*ROOT.glob("docs/**/*.md"), *ROOT.glob("docs/**/*.rst")}
    assert len(sources) > 20
    for source in sources:
        page = site / source.relative_to(ROOT / "docs").with_suffix(".html")
        assert page.exists(), page


def test_links_have_targets_and_nothing_external_is_loaded(pages):
    names = {path: {tag["id"] for tag in page.find_all(id=True)} for path, page in pages.items()}
    followed = 0
    for path, page in pages.items():
        for tag in page.find_all(["a", "link", "img", "script", "source", "iframe"]):
            parts = urllib.parse.urlsplit(address := tag.get("href") or tag.get("src") or "")
            if not address or parts.scheme == "data":  # nothing, or in the page itself
                continue
            if parts.scheme:
                assert tag.name == "a", f"{path} loads {address}"
                continue
            followed += 1
            parts = urllib.parse.urlsplit(urllib.parse.unquote(address))
            target = (path.parent / parts.path).resolve() if parts.path else path
            assert target.is_file(), f"{path}: {address}"
            if parts.fragment and target in names:
                assert parts.fragment in names[target], f"{path}: {address}"
    assert followed > 1000


def test_images_have_alternative_texts(pages):
    images = [tag for page in pages.values() for tag in page.select("article img[src]")]
    assert len(images) > 10
    for tag in images:
        assert len(tag.get("alt", "")) > 20, tag


def test_images_are_smaller_than_a_megabyte(site):
    for path in site.rglob("*"):
        if path.suffix in (".png", ".gif", ".svg", ".jpg"):
            assert path.stat().st_size < 1_000_000, path


@pytest.fixture(scope="session")
def address(site):
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
    return [f"{entry['level']}: {entry['message']}" for entry in browser.get_log("browser")]


@pytest.mark.parametrize("width", [PHONE, DESKTOP])
@pytest.mark.parametrize("theme", ["light", "dark"])
def test_pages_in_a_browser(browser, address, site, pages, theme, width):
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


# The state of the player, for tests: ready, search, step, playing.
PLAY = "document.getElementById('player').dataset"

# A script that returns a canvas's width, its most common colour, and its picture.
DRAWN = """
const canvas = document.querySelector(arguments[0]);
const {width, height} = canvas;
const copy = Object.assign(document.createElement("canvas"), {width, height});
const context = copy.getContext("2d", {willReadFrequently: true});
context.drawImage(canvas, 0, 0);
const data = context.getImageData(0, 0, width, height).data;
const colours = {};
for (let at = 0; at < data.length; at += 4 * 7) {
    const colour = data.slice(at, at + 3).join();
    colours[colour] = (colours[colour] ?? 0) + 1;
}
const [most] = Object.entries(colours).sort((one, other) => other[1] - one[1]);
return [width, most[0], copy.toDataURL()];
"""


class Player:
    """The page in a browser."""

    def __init__(self, browser: Any, address: str, **look: Any) -> None:
        self.browser = browser
        browser.get("about:blank")  # else a change of the fragment would load nothing
        console_messages(browser)
        open_page(browser, address, **look)
        self.wait(lambda: self.state("ready") == "yes")

    def wait(self, condition: Any) -> None:
        from selenium.webdriver.support.wait import WebDriverWait

        WebDriverWait(self.browser, 20, 0.02).until(lambda _: condition())

    def state(self, name: str) -> str | None:
        value: str | None = self.browser.execute_script(f"return {PLAY}.{name}")
        return value

    @property
    def step(self) -> int:
        return int(self.state("step") or 0)

    def reach(self, step: int) -> None:
        self.wait(lambda: self.step == step and self.state("playing") == "no")

    def one(self, selector: str) -> Any:
        return self.browser.find_element("css selector", f"#player {selector}")

    def all(self, selector: str) -> list[Any]:
        found: list[Any] = self.browser.find_elements("css selector", f"#player {selector}")
        return found

    def press(self, key: str) -> None:
        self.browser.find_element("css selector", "body").send_keys(key)

    def choose(self, what: str, value: object) -> None:
        self.one(f"[data-pick={what}] option[value='{value}']").click()

    def label(self, control: str, value: str) -> Any:
        return self.one(f"label:has(input[name={control}][value='{value}'])")

    def scrub(self, step: int) -> None:
        self.browser.execute_script(
            "const slider = document.querySelector('#player input[type=range]');"
            "slider.value = arguments[0];"
            "slider.dispatchEvent(new Event('input', {bubbles: true}));",
            step,
        )

    def drawn(self, canvas: str = ".map") -> tuple[int, tuple[int, ...], str]:
        width, colour, picture = self.browser.execute_script(DRAWN, f"#player {canvas}")
        return width, tuple(map(int, colour.split(","))), picture

    def text(self, selector: str) -> str:
        return str(self.one(selector).text)


def most_common(name: str) -> tuple[int, ...]:
    """The colour of cells without probability, in the light or the dark theme."""
    from DroneSwarmSearch.rendering import PALETTES

    return PALETTES["sea"][0 if name == "light" else -1]


@pytest.mark.parametrize("served", [True, False], ids=["served", "from files"])
def test_a_search_is_played(browser, address, site, served):
    root = address if served else site.as_uri()
    player = Player(browser, f"{root}/play.html#man-overboard/planner/0")
    assert (player.step, player.text("[data-show=success]")) == (0, "0.0%")
    assert player.text(".outcome") == ""
    player.choose("speed", 32)
    player.one(".big").click()
    player.wait(lambda: player.step > 3)
    assert player.state("playing") == "yes" and not player.one(".big").is_displayed()
    player.wait(lambda: player.state("playing") == "no")
    end = player.step
    minutes = f"{end // 6}:{end % 6}0"  # a step takes 10 seconds
    assert player.text(".outcome") == f"Found in {minutes} min"
    assert player.text(".step") == f"{minutes} of 30:00 min, step {end}"
    assert player.text(".incident").startswith("A passenger is missing from a ferry")
    assert float(player.text("[data-show=success]").rstrip("%")) > 5
    player.choose("speed", 2)  # to click before the end
    player.one(".toggle").click()  # once more, from the start
    player.wait(lambda: 0 < player.step < end)
    player.one(".map").click()
    assert player.state("playing") == "no"
    assert console_messages(browser) == []


def test_steps_keys_and_the_slider(browser, address):
    from selenium.webdriver.common.keys import Keys

    player = Player(browser, f"{address}/play.html#gale/parallel-sweep/1")
    top = browser.execute_script("return scrollY")
    for key, step in ((Keys.ARROW_RIGHT, 1), (Keys.ARROW_LEFT, 0), (Keys.ARROW_LEFT, 0)):
        player.press(key)
        player.reach(step)
    player.press(Keys.SPACE)
    player.wait(lambda: player.step > 0 and player.state("playing") == "yes")
    player.press(Keys.SPACE)
    player.wait(lambda: player.state("playing") == "no")
    player.label("policy", "planner").click()  # which then has the focus
    browser.switch_to.active_element.send_keys(Keys.SPACE)
    player.wait(lambda: player.state("playing") == "yes")
    browser.switch_to.active_element.send_keys(Keys.ARROW_DOWN)  # the next policy
    player.wait(lambda: "planner" not in browser.current_url)
    browser.switch_to.active_element.send_keys(Keys.SPACE)
    player.wait(lambda: player.state("playing") == "no")
    player.scrub(40)
    player.reach(40)
    for button, step in (("forward", 41), ("back", 40), ("first", 0)):
        player.one(f"[data-do={button}]").click()
        player.reach(step)
    player.press(Keys.END)
    player.reach(int(player.one("input[type=range]").get_attribute("max")))
    player.press(Keys.HOME)
    player.reach(0)
    player.one("input[type=range]").send_keys(Keys.ARROW_RIGHT)
    player.reach(1)
    assert browser.execute_script("return scrollY") == top
    browser.execute_script("document.querySelector('.sidebar-search').focus()")
    browser.switch_to.active_element.send_keys("m h")
    assert player.one("input[value=posterior]").is_selected()
    assert console_messages(browser) == []


def test_searches_policies_and_seeds_are_chosen(browser, address):
    player = Player(browser, f"{address}/play.html")
    names = [option.get_attribute("value") for option in player.all(".searches option")]
    assert len(names) >= 5
    for name in names:
        player.choose("search", name)
        player.wait(lambda name=name: player.state("search") == name)
        assert "cells" in player.text(".reason")
        for seed in (0, 2):
            player.choose("seed", seed)
            policies = [each.get_attribute("value") for each in player.all("[name=policy]")]
            assert len(policies) >= 4
            for policy in policies:
                player.label("policy", policy).click()
                assert browser.current_url.endswith(f"#{name}/{policy}/{seed}")
                player.scrub(1000)
                player.wait(lambda: player.text(".outcome"))
    player = Player(browser, f"{address}/play.html#no-search/planner/1")
    assert player.state("search") == names[0]
    assert console_messages(browser) == []


def test_views_of_the_map(browser, address):
    player = Player(browser, f"{address}/play.html#two-positions/planner/1")
    player.scrub(60)
    player.reach(60)
    pictures = {}
    for view in ("prior", "both", "posterior"):
        player.label("view", view).click()
        player.wait(lambda view=view: view in player.one(".map").get_attribute("aria-label"))
        pictures[view] = player.drawn()
    assert len({picture for _, _, picture in pictures.values()}) == 3
    assert pictures["both"][0] > 1.4 * pictures["prior"][0]
    player.press("m")
    player.wait(lambda: player.one("input[value=both]").is_selected())
    player.press("m")
    player.wait(lambda: player.one("input[value=prior]").is_selected())
    player.press("h")
    player.wait(lambda: not player.one("[data-pick=person]").is_selected())
    player.wait(lambda: player.drawn()[2] != pictures["prior"][2])
    player.one("[data-pick=person]").click()
    player.wait(lambda: player.drawn()[2] == pictures["prior"][2])
    assert console_messages(browser) == []


@pytest.mark.parametrize("width", [PHONE, DESKTOP])
@pytest.mark.parametrize("theme", ["light", "dark"])
def test_the_player_fits_the_page(browser, address, theme, width):
    player = Player(browser, f"{address}/play.html#gale/imitation/0", theme=theme, width=width)
    other = "dark" if theme == "light" else "light"
    player.scrub(30)
    player.reach(30)
    assert player.drawn()[1] == most_common(theme)
    for view in ("both", "posterior"):
        player.label("view", view).click()
        player.wait(lambda view=view: view in player.one(".map").get_attribute("aria-label"))
        assert browser.execute_script("return document.documentElement.scrollWidth") <= width
        boxes = [each.rect for each in player.all(":is(button, select, canvas, .segments label)")]
        assert all(box["x"] >= 0 and box["x"] + box["width"] <= width for box in boxes)
        touched = [box for box in boxes if box["width"] and box["width"] < 300]
        assert len(touched) > 8 and all(box["height"] >= 44 for box in touched)
    browser.execute_script("document.body.dataset.theme = arguments[0]", other)
    player.wait(lambda: player.drawn()[1] == most_common(other))
    assert console_messages(browser) == []


def test_nothing_moves_for_those_who_want_less_motion(browser, address):
    from selenium.webdriver.common.keys import Keys

    reduce = {"features": [{"name": "prefers-reduced-motion", "value": "reduce"}]}
    player = Player(browser, f"{address}/play.html#gale/imitation/0")
    browser.execute_cdp_cmd("Emulation.setEmulatedMedia", reduce)
    player.press(Keys.ARROW_RIGHT)
    player.reach(1)
    player.choose("speed", 2)
    before = player.drawn()[2]
    player.one(".toggle").click()
    between = {player.drawn()[2] for _ in range(4)}
    assert len(between | {before}) <= 2  # pictures of steps, none between them
    browser.execute_cdp_cmd("Emulation.setEmulatedMedia", {"features": []})


def test_the_map_does_not_move_during_an_episode(browser, address):
    player = Player(browser, f"{address}/play.html#wreck/planner/0")
    places = set()
    end = int(player.one("input[type=range]").get_attribute("max"))
    for step in (0, 1, end // 2, end):
        player.scrub(step)
        player.reach(step)
        rects = [player.one(part).rect for part in (".map", ".curve", ".toggle", ".reason")]
        places.add(str(rects))
    assert len(places) == 1


def test_a_file_of_the_export_is_played(browser, address, tmp_path):
    from DroneSwarmSearch import Scale, Scenario
    from DroneSwarmSearch.evaluation import NamedSearch, export

    path, wrong, sea = (tmp_path / name for name in ("mine.json", "wrong.json", "sea.json"))
    puddle = Scenario(5, person_initial_position=(2, 2), vector=(0, 0), timestep_limit=20)
    export(["parallel-sweep"], NamedSearch("puddle", "Mine.", puddle), path, seeds=[4])
    lake = NamedSearch("lake", "A lake.", puddle, scale=Scale(20, 6))
    export(["parallel-sweep"], lake, sea, seeds=[4])
    wrong.write_text('{"format": "another"}', "utf-8")
    player = Player(browser, f"{address}/play.html")
    player.one("input[type=file]").send_keys(str(path))
    player.wait(lambda: player.state("search") == "file mine.json")
    assert player.text(".incident") == "Mine."
    assert player.text(".reason").startswith("5 x 5 cells; 1 drone")
    assert player.text(".step") == "Step 0 of 20"
    pictures = [player.drawn(canvas)[2] for canvas in (".map", ".curve")]
    assert player.one("[name=policy]").get_attribute("value") == "parallel-sweep"
    player.scrub(1000)
    player.wait(lambda: "ound in" in player.text(".outcome"))
    player.one("input[type=file]").send_keys(str(sea))
    player.wait(lambda: player.state("search") == "file sea.json")
    player.wait(lambda: player.text(".step") == "0:00 of 2:00 min, step 0")
    for canvas, picture in zip((".map", ".curve"), pictures, strict=True):
        assert player.drawn(canvas)[2] != picture, "a scale bar and north; minutes"
    player.one("input[type=file]").send_keys(str(wrong))
    player.wait(lambda: "not written by the command" in player.text(".outcome"))
    player.scrub(3)  # and the message stays
    player.reach(3)
    assert "not written by the command" in player.text(".outcome")
    player.choose("search", "harbour")
    player.wait(lambda: player.state("search") == "harbour" and not player.text(".outcome"))
    assert console_messages(browser) == []


def test_without_javascript_there_is_a_video(browser, address):
    browser.execute_cdp_cmd("Emulation.setScriptExecutionDisabled", {"value": True})
    try:
        open_page(browser, f"{address}/play.html")
        video = browser.find_element("css selector", "#player img")
        assert video.is_displayed() and video.rect["width"] > 300
        assert "With JavaScript" in browser.find_element("css selector", "#player").text
        assert not browser.find_elements("css selector", "#player canvas")
    finally:
        browser.execute_cdp_cmd("Emulation.setScriptExecutionDisabled", {"value": False})
