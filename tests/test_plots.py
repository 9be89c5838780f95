"""Plots of evaluations show the measured values."""

from __future__ import annotations

import subprocess
import sys
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from DroneSwarmSearch.evaluation import SUITE, Episodes, Evaluation, StorageError, evaluate
from DroneSwarmSearch.evaluation.episodes import Reliability
from DroneSwarmSearch.evaluation.recording import frames
from DroneSwarmSearch.planning import SuccessBound
from DroneSwarmSearch.rendering.labels import outcome_in_brief

pytest.importorskip("matplotlib")
Image = pytest.importorskip("PIL.Image")

from matplotlib.colors import to_hex  # noqa: E402 (needs the package)

from DroneSwarmSearch.evaluation import maps, plot_style, plots  # noqa: E402


def evaluation(
    policy: str, search: str = "pond", *, share: float = 0.5, bound: float | None = None
) -> Evaluation:
    """40 episodes, of which a share succeeds, each in a different step."""
    where = SUITE[search]
    limit, n = where.scenario.timestep_limit, 40
    found = np.zeros((n, len(where.scenario.situation)), np.int64)
    for episode in range(round(share * n)):
        found[episode] = 1 + episode % limit
    endings = np.where(found[:, 0] > 0, 1, 4)
    episodes = Episodes(found, endings, np.full(n, limit), np.zeros(n), Reliability.empty())
    upper = None
    if bound is not None:
        upper = SuccessBound(np.linspace(0.0, bound, limit + 1), bound, 0.0, 1.0)
    return Evaluation(policy, where, 0, "swarm", "dict", episodes, upper)


def table(*bins: tuple[float, int, int]) -> Reliability:
    """A reliability table from (forecast, searches, finds)."""
    counted = Reliability.empty()
    for forecast, searches, finds in bins:
        outcomes = np.arange(searches) < finds
        counted.count(np.full(searches, forecast), outcomes.astype(np.int64))
    return counted


def texts(figure: Any) -> str:
    """All text in a figure."""
    from matplotlib.text import Text

    return "\n".join(each.get_text() for each in figure.findobj(Text))


class TestCurves:
    def test_each_policy_has_a_curve_a_band_and_an_entry_in_the_legend(self) -> None:
        several = [evaluation("random", share=0.1), evaluation("planner", share=0.9)]
        figure = plots.success_over_time(several)
        (axes,) = figure.axes
        assert len(axes.lines) == len(axes.collections) == 2
        for line, band, each in zip(axes.lines, axes.collections, several, strict=True):
            assert np.array_equal(line.get_ydata(), each.success_by_time.value)
            assert np.array_equal(line.get_xdata(), np.arange(41))
            (path,) = band.get_paths()
            assert path.vertices[:, 1].max() == each.success_by_time.high.max()
        (legend,) = figure.legends
        assert [each.get_text() for each in legend.texts] == ["planner 90.0%", "random 10.0%"]
        assert "pond" in texts(figure)

    def test_the_bound_is_a_dashed_line(self) -> None:
        figure = plots.success_over_time([evaluation("planner", bound=0.75)])
        bound, curve = figure.axes[0].lines
        assert bound.is_dashed()
        assert not curve.is_dashed()
        assert np.array_equal(bound.get_ydata(), np.linspace(0.0, 0.75, 41))
        assert "bound 75.0%" in texts(figure)

    def test_a_policy_looks_the_same_in_every_plot(self) -> None:
        alone = plots.success_over_time([evaluation("random")])
        last = plots.success_over_time([evaluation(name) for name in ("mine", "planner", "random")])
        colours = [to_hex(figure.axes[0].lines[-1].get_color()) for figure in (alone, last)]
        assert colours[0] == colours[1]
        assert len({to_hex(line.get_color()) for line in last.axes[0].lines}) == 3

    def test_all_looks_differ(self) -> None:
        looks = [*plot_style.LOOKS.values(), *plot_style.OTHERS]
        assert len({look.colour for look in looks}) == len({look.marker for look in looks}) == 14

    def test_each_search_has_a_panel(self) -> None:
        several = [
            evaluation(policy, search, bound=1.0)
            for search in ("fog", "pond", "wreck")
            for policy in ("planner", "random")
        ]
        figure = plots.suite_over_time(several, columns=2)
        assert [axes.get_title("left") for axes in figure.axes] == ["fog", "pond", "wreck"]
        assert [len(axes.lines) for axes in figure.axes] == [3, 3, 3]
        for axes, each in zip(figure.axes, several[::2], strict=True):
            assert axes.get_xlim() == (0, each.limit)
        for name in ("planner", "random", "bound: no policy can exceed it"):
            assert texts(figure).count(name) == 1

    def test_evaluations_of_several_searches_or_none_are_refused(self) -> None:
        with pytest.raises(ValueError, match=r"evaluations must be of one search, got pond, fog"):
            plots.success_over_time([evaluation("planner"), evaluation("planner", "fog")])
        for draw in (plots.success_over_time, plots.suite_over_time, plots.success_by_search):
            with pytest.raises(ValueError, match=r"evaluations must be at least one, got none"):
                draw([])
        with pytest.raises(ValueError, match=r"columns must be an integer of at least 1, got 0"):
            plots.suite_over_time([evaluation("planner")], columns=0)


def test_rows_show_success_interval_and_bound() -> None:
    several = [
        evaluation(policy, search, share=share, bound=bound)
        for search, bound in (("fog", 0.9), ("pond", 0.8))
        for policy, share in (("planner", 0.75), ("random", 0.25))
    ]
    (axes,) = plots.success_by_search(several).axes
    dots = [(float(line.get_xdata()[0]), line.get_ydata()[0]) for line in axes.lines]
    assert [x for x, _ in dots] == [0.75, 0.25, 0.75, 0.25]
    assert [round(y) for _, y in dots] == [0, 0, 1, 1]
    assert [label.get_text() for label in axes.get_yticklabels()] == ["fog", "pond"]
    ends = [bar.get_segments()[0] for bar in axes.collections]
    bounds = [segment[0, 0] for segment in ends if segment[0, 0] == segment[1, 0]]
    assert bounds == [0.9, 0.8]
    bars = [segment[:, 0].tolist() for segment in ends if segment[0, 0] != segment[1, 0]]
    assert bars == [pytest.approx([each.success.low, each.success.high]) for each in several]


class TestEpisode:
    def test_it_shows_the_tracks_the_searches_and_the_persons(self) -> None:
        past = list(frames("greedy-posterior", "harbour", seed=2))
        figure = maps.episode("greedy-posterior", "harbour", seed=2)
        last = past[-1][1]
        for axes, frame in zip(figure.axes[:2], past[-1], strict=True):
            assert np.array_equal(axes.images[0].get_array(), frame.matrix)
            drawn = [line.get_xydata() for line in axes.lines]
            for drone in range(2):
                track = [each.drones[drone] for _, each in past]
                assert any(np.array_equal(track, each) for each in drawn)
                searched = [each.drones[drone] for _, each in past if each.searching[drone]]
                assert any(np.array_equal(searched, each) for each in drawn)
            person = [each.persons[0] for _, each in past]
            assert any(np.array_equal(person, each) for each in drawn)
        title = f"greedy-posterior searching harbour, seed 2: {outcome_in_brief(last)}"
        assert title in texts(figure)

    def test_it_shows_any_step(self) -> None:
        figure = maps.episode("random", "pond", seed=1, step=5, name="chance")
        assert "chance searching pond, seed 1, step 5 of 40" in texts(figure)
        _, frame = list(frames("random", "pond", seed=1))[5]
        assert np.array_equal(figure.axes[1].images[0].get_array(), frame.matrix)

    def test_bad_input_is_refused(self) -> None:
        with pytest.raises(ValueError, match=r"step must be an integer of at least 0, got -1"):
            maps.episode("random", "pond", step=-1)
        with pytest.raises(ValueError, match=r"search must be one of pond"):
            maps.episode("random", "pnd")


class TestReliability:
    def test_points_are_forecasts_and_outcomes(self) -> None:
        tables = {
            "prior": table((0.04, 200, 4), (0.3, 100, 10)),
            "posterior": table((0.03, 100, 3), (0.15, 0, 0), (0.003, 40, 0)),
        }
        figure = plots.reliability(tables)
        (axes,) = figure.axes
        points = [line.get_xydata() for line in axes.lines if line.get_marker() in ("D", "o")]
        prior, posterior = (each for each in points if len(each))
        assert prior == pytest.approx(np.array([(0.04, 0.02), (0.3, 0.1)]))
        assert posterior == pytest.approx(np.array([(0.03, 0.03)]))
        triangles = [line.get_xydata() for line in axes.lines if line.get_marker() == "v"]
        ((forecast, high),) = np.concatenate(triangles)
        assert forecast == pytest.approx(0.003)
        assert 0.0 < high < 0.1
        error = (200 * 0.02 + 100 * 0.2) / 300
        assert f"prior (mean error {100 * error:.2f}%)" in texts(figure)

    def test_tables_without_searches_are_refused(self) -> None:
        with pytest.raises(ValueError, match=r"tables must hold at least one search, got \['a'\]"):
            plots.reliability({"a": Reliability.empty()})


class TestFiles:
    def test_equal_plots_make_equal_files(self, tmp_path: Path) -> None:
        def figure() -> Any:
            return plots.success_over_time([evaluation("planner", bound=0.9), evaluation("random")])

        png, svg = plot_style.save(figure(), tmp_path / "new" / "curves")
        assert (png.name, svg.name) == ("curves.png", "curves.svg")
        with Image.open(png) as picture:
            assert picture.size == (1002, 500)
        for one, other in zip(
            (png, svg), plot_style.save(figure(), tmp_path / "again"), strict=True
        ):
            assert one.read_bytes() == other.read_bytes()

    def test_the_users_settings_have_no_effect_and_stay(self, tmp_path: Path) -> None:
        import matplotlib

        plain = plot_style.save(plots.success_over_time([evaluation("planner")]), tmp_path / "a")
        with matplotlib.rc_context({"font.size": 20, "lines.linewidth": 9}):
            own = plot_style.save(plots.success_over_time([evaluation("planner")]), tmp_path / "b")
            assert matplotlib.rcParams["font.size"] == 20
        assert plain[1].read_bytes() == own[1].read_bytes()

    def test_a_file_that_cannot_be_written_is_named(self, tmp_path: Path) -> None:
        (tmp_path / "file").touch()
        figure = plots.success_over_time([evaluation("planner")])
        with pytest.raises(StorageError, match=r"curves\.png"):
            plot_style.save(figure, tmp_path / "file" / "curves")

    def test_pyplot_is_not_imported(self) -> None:
        code = (
            "import sys; from DroneSwarmSearch.evaluation import maps;"
            "maps.episode('random', 'pond'); sys.exit('matplotlib.pyplot' in sys.modules)"
        )
        assert subprocess.run([sys.executable, "-c", code], check=False).returncode == 0

    def test_without_matplotlib_there_is_a_hint(self) -> None:
        code = (
            "import importlib, sys\n"
            "sys.modules['matplotlib'] = None\n"
            "for module in ('maps', 'plots'):\n"
            "    try:\n"
            "        importlib.import_module(f'DroneSwarmSearch.evaluation.{module}')\n"
            "    except ImportError as error:\n"
            "        print(error)\n"
        )
        done = subprocess.run(
            [sys.executable, "-c", code], capture_output=True, text=True, check=True
        )
        assert done.stdout.count("DroneSwarmSearchEnvironment[evaluation]") == 2


class TestCoverage:
    def test_labels_name_the_measure_of_the_mission(self) -> None:
        rescue = evaluation("planner")
        scenario = rescue.search.scenario.replace(mission="coverage")
        coverage = evaluate("parallel-sweep", scenario, episodes=2)
        curves = plots.success_over_time([coverage])
        assert curves.axes[0].get_ylabel() == "POS"
        assert np.array_equal(curves.axes[0].lines[0].get_ydata(), coverage.success_by_time.value)
        assert plots.success_over_time([rescue]).axes[0].get_ylabel() == "found"
        both = [rescue, coverage]
        assert plots.suite_over_time(both).axes[0].get_ylabel() == "found, or POS"
        label = plots.success_by_search(both).axes[0].get_xlabel()
        assert label == "every person found, or probability of success by the time limit"

    def test_a_map_without_persons_has_none_in_its_legend(self) -> None:
        scenario = SUITE["pond"].scenario.replace(mission="coverage", timestep_limit=3)
        assert "person" not in texts(maps.episode("parallel-sweep", scenario))
