"""The figures of the documentation and the calibration benchmark."""

import csv
import json
import re
from pathlib import Path
from xml.etree import ElementTree

import numpy as np
import pytest
from helpers import module_at

from DroneSwarmSearch.evaluation import SUITE

pytest.importorskip("matplotlib")

pytestmark = pytest.mark.thorough

ROOT = Path(__file__).parents[1]
DOCS = ROOT / "docs"
COMMITTED = DOCS / "figures"


figures = module_at(DOCS / "make_figures.py")
calibration = module_at(ROOT / "benchmarks" / "calibration.py")

NAMES = list(figures.REGISTRY)
THEMES = [theme.name for theme in figures.THEMES]


BACKGROUNDS = {"light": b"#ffffff", "dark": b"#131416"}


@pytest.mark.parametrize(
    ("name", "theme"),
    [
        pytest.param(name, theme, marks=[pytest.mark.slow] * ((number + other) % 2))
        for number, name in enumerate(NAMES)
        for other, theme in enumerate(figures.THEMES)
    ],
)
def test_figures_are_drawn(name, theme):
    """Each in one of the themes; in the slow run, each in both."""
    drawn = figures.svg(name, theme, figures.SHORT)
    root = ElementTree.fromstring(drawn)
    assert float(root.attrib["width"].removesuffix("pt")) == pytest.approx(432, abs=1)
    assert b"<text" not in drawn  # glyphs are paths, independent of fonts
    assert BACKGROUNDS[theme.name] in drawn


@pytest.mark.pictures
@pytest.mark.parametrize("name", NAMES)
@pytest.mark.parametrize("theme", THEMES)
def test_committed_figures_are_small(name, theme):
    size = (COMMITTED / f"{name}-{theme}.svg").stat().st_size
    assert 1000 < size < 150_000


@pytest.mark.parametrize("name", NAMES)
def test_a_page_shows_each_figure_with_an_alternative_text(name):
    texts = [page.read_text("utf-8") for page in DOCS.rglob("*.md")]
    descriptions = [
        description
        for text in texts
        for description in re.findall(rf"!\[([^\]]*)\]\([./]*figures/{name}-light\.svg\)", text)
    ]
    assert descriptions and all(len(description) > 40 for description in descriptions)


@pytest.mark.parametrize("page", ["README.md", "docs/index.md"])
def test_the_first_pages_state_the_results_of_the_leaderboard(page):
    (text,) = re.findall(r"[Bb]ound \d.*random.*%", (ROOT / page).read_text("utf-8"))
    stated = dict(re.findall(r"([\w-]+)(?: moves)? (\d+)%", text.lower()))
    results = figures.suite_results()
    for name in ("bound", "planner", "imitation", "greedy-posterior", "random"):
        assert float(stated[name]) == round(100 * results[name].mean())


@pytest.mark.parametrize("detection", [0.4, 0.8])
def test_the_kept_fractions_predict_the_episodes_without_a_find(detection):
    episodes = 1000
    predicted = np.minimum(np.cumprod(figures.miss(detection).kept), 1.0)  # rounding may exceed 1
    measured = figures.shares_not_found(detection, episodes)[1:]
    deviation = np.sqrt(predicted * (1 - predicted) / episodes)
    assert len(predicted) == figures.SCENE["timestep_limit"]
    assert (np.abs(measured - predicted) <= 4 * deviation + 1e-12).all()


def margin(episodes: int) -> float:
    """Return four standard deviations of a total variation (Efron-Stein inequality)."""
    return 4 * 0.5 / np.sqrt(episodes)


@pytest.mark.parametrize("setting", calibration.PACKAGES["DroneSwarmSearch"][1][::3])
def test_this_package_is_at_the_floor(setting):
    episodes = 1500
    steps = 24
    seen = calibration.ours(setting, episodes, steps)
    distance = calibration.distances(seen)
    for step in range(steps + 1):
        floor = calibration.floor(seen.matrix[step], episodes)
        assert abs(distance[step] - floor) < margin(episodes)


def committed_results() -> list[dict[str, str]]:
    with (COMMITTED / "calibration.csv").open(encoding="utf-8", newline="") as file:
        return list(csv.DictReader(file))


def test_committed_results_are_complete_and_at_the_floor():
    rows = committed_results()
    for name, (_, settings) in calibration.PACKAGES.items():
        own = [row for row in rows if row["package"] == name]
        assert len(own) == len(settings) * (calibration.STEPS + 1)
        assert all(int(row["episodes"]) >= 4000 for row in own)
    for row in rows:
        if row["package"] == "DroneSwarmSearch":
            difference = abs(float(row["distance"]) - float(row["floor"]))
            assert difference < margin(int(row["episodes"]))


def test_the_model_page_states_how_far_opendrift_is_from_the_map():
    page = " ".join((DOCS / "model.md").read_text("utf-8").split())
    with (COMMITTED / "opendrift.csv").open(encoding="utf-8", newline="") as file:
        rows = list(csv.DictReader(file))

    def of(quantity: str, hours: float | None = None) -> np.ndarray:
        """The values of the map and of OpenDrift, shape (rows, 2)."""
        return np.array(
            [
                (float(row["map"]), float(row["opendrift"]))
                for row in rows
                if row["quantity"] == quantity and hours in (None, float(row["hours"]))
            ]
        )

    assert len({row["object_class"] for row in rows if row["quantity"] == "spread"}) == 9
    for hours, percent in ((1, 3), (6, 7)):
        ours, theirs = of("spread", hours).T
        assert np.abs(theirs / ours - 1).max() < percent / 100
    excess = {hours: float(np.diff(of("distance", hours)).mean()) for hours in (1, 6)}
    assert f"by {excess[1]:.3f} on average after one hour and by {excess[6]:.3f} after six" in page
    forecast, found = of("success").T
    assert (np.abs(forecast - found - 0.015) < 0.01).all()  # up to two points


def test_the_model_page_states_what_plans_find_off_a_coast():
    page = (DOCS / "model.md").read_text("utf-8")
    with (COMMITTED / "opendrift-coast.csv").open(encoding="utf-8", newline="") as file:
        rows = list(csv.DictReader(file))
    assert len(rows) == 4
    for row in rows:
        shares = " | ".join(f"{float(row[name]):.1%}" for name in ("forecast", "found"))
        assert f"| `{row['person']}` | `{row['policy']}` | {shares} |" in page


def test_the_guide_states_how_far_forecasts_of_changing_drift_are_from_the_finds():
    page = " ".join((DOCS / "guides" / "evaluation.md").read_text("utf-8").split())
    scenes = json.loads((COMMITTED / "tracks.json").read_text("utf-8"))
    tracks, constant = (
        [
            100 * (each[drift]["forecast"] - each[drift]["found"])
            for scene in scenes.values()
            for each in scene["results"].values()
        ]
        for drift in ("tracks", "constant")
    )
    assert f"at most {max(tracks):.1f} points more than they find" in page
    assert f"forecast {min(constant):.0f} to {max(constant):.0f} points more" in page
    for name, scene in scenes.items():
        row = scene["results"]["planner"]["constant"]
        stated = f"forecast {row['forecast']:.0%} and find {row['found']:.0%}"
        assert stated in SUITE[name].reason
