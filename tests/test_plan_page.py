"""The page of a plan, plan.html: by itself, and in a browser (slow; as in test_site.py)."""

import base64
import json
import re
import time
from html import unescape
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from DroneSwarmSearch.incident import FlightPlan, Incident, write
from DroneSwarmSearch.incident import plan as plan_flights

pytest.importorskip("cmaes")

pytestmark = pytest.mark.thorough

ROOT = Path(__file__).parents[1]

ISLAND = {
    "type": "Polygon",
    "coordinates": [[[7.86, 54.18], [7.88, 54.18], [7.88, 54.19], [7.86, 54.19], [7.86, 54.18]]],
}


@pytest.fixture(scope="module")
def plan(tmp_path_factory) -> FlightPlan:
    coast = tmp_path_factory.mktemp("coast") / "island.geojson"
    coast.write_text(json.dumps(ISLAND), "utf-8")
    incident = Incident(
        position=(54.18, 7.85),
        time="2026-03-01T05:30Z",
        object_class="PIW-1",
        wind="300 20kn",
        current="160 0.5kn",
        endurance="25min",
        drones=7,
        coast=coast,
    )
    return plan_flights(incident, seconds=0.1)


@pytest.fixture(scope="module")
def page(plan, tmp_path_factory):
    folder = tmp_path_factory.mktemp("plan")
    write(plan, folder)
    return folder / "plan.html"


def data_of(text: str) -> dict[str, Any]:
    (content,) = re.findall(r'<script type="application/json" id="data">(.*?)</script>', text)
    return json.loads(content)


def test_it_needs_no_other_file(page):
    text = page.read_text("utf-8")
    assert text.count("<!doctype html>") == 1
    text = text.replace('<link rel="icon" href="data:,">', "")  # no favicon is asked for
    assert not re.findall(r"""(?:src|href)\s*=|url\(|@import|https?:|fetch\(|import\s*\(""", text)
    assert page.stat().st_size < 1_000_000


def test_the_page_in_the_documentation_is_up_to_date():
    """After a change of its parts: python docs/make_pictures.py plan."""
    text = (ROOT / "docs" / "static" / "plan.html").read_text("utf-8")
    parts = ROOT / "DroneSwarmSearch" / "incident" / "files" / "page"
    if not parts.is_dir():
        pytest.skip("the package is installed elsewhere")
    for name in ("page.css", "page.js"):
        assert (parts / name).read_text("utf-8") in text


def test_it_says_what_the_orders_say(plan, page):
    text = unescape(page.read_text("utf-8"))
    for sentence in (plan.incident.sentence, *plan.briefing, *plan.assumptions):
        assert sentence in text
    for drone in range(7):
        for name, value in plan.order(drone).items():
            if name != "drone" and value:
                assert f"<td>{value}</td>" in text
    assert text.count("<table>") == 2, "at most six drones in a table"


def test_its_data_are_those_of_the_plan(plan, page):
    data = data_of(page.read_text("utf-8"))
    assert data["duration"] == (plan.landed - plan.incident.start).total_seconds()
    assert data["success"]["values"][-1] == pytest.approx(plan.probability_of_success, abs=1e-4)
    assert len(data["land"]) == 1
    for flight, drawn in zip(plan.flights, data["flights"], strict=True):
        metres = plan.incident.plane.metres(*np.array([point[1:3] for point in flight]).T)
        assert np.array(drawn["points"]) == pytest.approx(metres, abs=0.06)
    persons = data["persons"]
    packed = np.frombuffer(base64.b64decode(persons["positions"]), "<i2")
    cloud = persons["unit"] * packed.reshape(-1, persons["count"], 2)
    begin = plan.incident.seconds(plan.incident.start)
    error = np.std(cloud[0], axis=0).max() / np.sqrt(persons["count"])
    assert cloud[0].mean(axis=0) == pytest.approx(plan.particles.mean(begin), abs=4 * error)
    swept = np.bincount(persons["swept"], minlength=persons["count"])
    assert {flight["detection"] for flight in data["flights"]} == {0.8}
    found = 1 - 0.2**swept
    assert found.mean() == pytest.approx(plan.probability_of_success, abs=0.06)


def test_names_from_elsewhere_are_no_markup(plan, page, tmp_path):
    from dataclasses import replace

    incident = plan.incident.changed(object_class="PIW-1")
    hostile = '</script><script>alert("$x_$")</script>'
    object.__setattr__(incident, "tracks", hostile)
    write(replace(plan, incident=incident), tmp_path)
    text = (tmp_path / "plan.html").read_text("utf-8")
    assert "<script>alert" not in text
    assert text.count("<script") == page.read_text("utf-8").count("<script")


# In a browser.


def shown(browser: Any) -> dict[str, Any]:
    return browser.execute_script(
        """return {
            time: Number(document.getElementById("time").value),
            clock: document.getElementById("clock").textContent,
            button: document.getElementById("play").textContent,
            success: document.getElementById("success").textContent,
            width: document.documentElement.scrollWidth,
            sea: [...document.getElementById("map").getContext("2d").getImageData(3, 3, 1, 1).data],
        };"""
    )


def opened(browser: Any, page: Any, theme: str = "light", width: int = 1280) -> None:
    size = {"width": width, "height": 900, "deviceScaleFactor": 1, "mobile": width < 500}
    browser.execute_cdp_cmd("Emulation.setDeviceMetricsOverride", size)
    features = [{"name": "prefers-color-scheme", "value": theme}]
    browser.execute_cdp_cmd("Emulation.setEmulatedMedia", {"features": features})
    browser.get(page.as_uri())


def press(browser: Any, key: str) -> None:
    from selenium.webdriver.common.action_chains import ActionChains

    ActionChains(browser).send_keys(key).perform()


@pytest.mark.slow
@pytest.mark.parametrize("width", [390, 1280])
@pytest.mark.parametrize("theme", ["light", "dark"])
def test_it_is_drawn_in_both_themes(browser, page, theme, width):
    opened(browser, page, theme, width)
    state = shown(browser)
    assert state["width"] <= width
    assert state["clock"] == "06:30:00 UTC" and state["success"] == "0%"
    assert (sum(state["sea"][:3]) > 600) == (theme == "light")
    assert not [entry for entry in browser.get_log("browser") if entry["level"] == "SEVERE"]


@pytest.mark.slow
def test_it_plays_by_keyboard(browser, page, plan):
    from selenium.webdriver.common.keys import Keys

    opened(browser, page)
    press(browser, Keys.ARROW_RIGHT)
    press(browser, Keys.ARROW_RIGHT)
    assert shown(browser)["time"] == 60
    press(browser, Keys.ARROW_LEFT)
    assert shown(browser)["time"] == 30
    press(browser, Keys.END)
    state = shown(browser)
    assert state["time"] == pytest.approx(
        (plan.landed - plan.incident.start).total_seconds(), abs=1
    )
    assert state["success"] == f"{100 * plan.probability_of_success:.0f}%"
    press(browser, Keys.HOME)
    press(browser, " ")
    assert shown(browser)["button"] == "Pause"
    time.sleep(0.5)
    press(browser, " ")
    state = shown(browser)
    assert state["button"] == "Play" and 5 < state["time"] < 600
    browser.find_element("id", "play").click()
    press(browser, " ")
    assert shown(browser)["button"] == "Play", "space on the focused button plays or pauses once"


@pytest.mark.slow
def test_it_prints_on_white_paper(browser, page):
    opened(browser, page, "dark")
    printed = browser.execute_cdp_cmd("Page.printToPDF", {"preferCSSPageSize": True})
    content = base64.b64decode(printed["data"])
    assert content.startswith(b"%PDF")
    assert 1 <= len(re.findall(rb"/Type\s*/Page\b", content)) <= 3
    assert sum(shown(browser)["sea"][:3]) < 300, "dark again afterwards"
