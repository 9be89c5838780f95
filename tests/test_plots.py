"""Figures of evaluations: what they show is what was measured, and files are whole."""

from __future__ import annotations

import importlib
import subprocess
import sys
from itertools import pairwise
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from DroneSwarmSearch.evaluation import SUITE, Episodes, Evaluation, Reliability, StorageError
from DroneSwarmSearch.evaluation.record import frames
from DroneSwarmSearch.planning import SuccessBound
from DroneSwarmSearch.rendering.labels import outcome_in_brief

pytest.importorskip("matplotlib")
Image = pytest.importorskip("PIL.Image")

from matplotlib.colors import to_hex  # noqa: E402 (they need the package)

from DroneSwarmSearch.evaluation import plots  # noqa: E402


def made_up(
    policy: str, search: str = "pond", *, share: float = 0.5, bound: float | None = None
) -> Evaluation:
    """An evaluation of 40 episodes of which a share succeeds, one step after another."""
    where = SUITE[search]
    limit, n, persons = (
        where.scenario.timestep_limit,
        40,
        len(where.scenario.person_initial_position),
    )
    found = np.zeros((n, persons), np.int64)
    for episode in range(round(share * n)):
        found[episode] = 1 + episode % limit
    endings = np.where(found[:, 0] > 0, 1, 4)
    episodes = Episodes(found, endings, np.full(n, limit), np.zeros(n), Reliability.empty())
    known = None
    if bound is not None:
        known = SuccessBound(np.linspace(0.0, bound, limit + 1), bound, 0.0, 1.0)
    return Evaluation(policy, where, 0, "swarm", "dict", episodes, known)


def table(*bins: tuple[float, int, int]) -> Reliability:
    """A reliability table from (chance, searches, finds)."""
    counted = Reliability.empty()
    for chance, searches, finds in bins:
        outcomes = np.arange(searches) < finds
        counted.count(np.full(searches, chance), outcomes.astype(np.int64))
    return counted


def words(figure: Any) -> str:
    """All that is written in a figure."""
    from matplotlib.text import Text

    return "\n".join(each.get_text() for each in figure.findobj(Text))


class TestCurves:
    def test_each_policy_has_its_curve_its_band_and_its_name(self) -> None:
        several = [made_up("planner", share=0.9), made_up("random", share=0.1)]
        figure = plots.success_over_time(several)
        (axes,) = figure.axes
        assert len(axes.lines) == len(axes.collections) == 2
        for line, band, each in zip(axes.lines, axes.collections, several, strict=True):
            assert np.array_equal(line.get_ydata(), each.success_by_time.value)
            assert np.array_equal(line.get_xdata(), np.arange(41))
            (path,) = band.get_paths()
            assert path.vertices[:, 1].max() == each.success_by_time.high.max()
            assert f"{each.policy} {100 * each.success.value:.1f}%" in words(figure)
        assert "pond" in words(figure)
        assert "bound" not in words(figure)

    def test_the_bound_is_bold_and_dashed(self) -> None:
        figure = plots.success_over_time([made_up("planner", bound=0.75)])
        bound, curve = figure.axes[0].lines
        assert bound.is_dashed()
        assert not curve.is_dashed()
        assert bound.get_linewidth() > curve.get_linewidth()
        assert np.array_equal(bound.get_ydata(), np.linspace(0.0, 0.75, 41))
        assert "bound 75.0%" in words(figure)

    def test_a_policy_looks_the_same_everywhere(self) -> None:
        alone = plots.success_over_time([made_up("random")])
        last = plots.success_over_time([made_up("mine"), made_up("planner"), made_up("random")])
        colours = [to_hex(figure.axes[0].lines[-1].get_color()) for figure in (alone, last)]
        assert colours[0] == colours[1]
        assert len({to_hex(line.get_color()) for line in last.axes[0].lines}) == 3

    def test_all_looks_differ(self) -> None:
        looks = [*plots.LOOKS.values(), *plots.OTHERS]
        assert len({look.colour for look in looks}) == len({look.marker for look in looks}) == 13

    def test_there_is_a_panel_for_each_search(self) -> None:
        several = [
            made_up(policy, search, bound=1.0)
            for search in ("fog", "pond", "wreck")
            for policy in ("planner", "random")
        ]
        figure = plots.suite_over_time(several, columns=2)
        drawn = [axes for axes in figure.axes if axes.lines]
        assert [axes.get_title("left") for axes in drawn] == ["fog", "pond", "wreck"]
        assert [len(axes.lines) for axes in drawn] == [3, 3, 3]
        for axes, each in zip(drawn, several[::2], strict=True):
            assert axes.get_xlim() == (0, each.limit)
        for name in ("planner", "random", "bound: no policy can exceed it"):
            assert words(figure).count(name) == 1

    def test_the_legend_takes_the_place_of_missing_panels(self) -> None:
        several = [made_up("planner", search) for search in ("fog", "pond", "wreck", "gale")]
        below = plots.suite_over_time(several, columns=4)
        beside = plots.suite_over_time(several, columns=3)
        assert len(below.legends) == 1
        assert len(below.axes) == 4
        assert not beside.legends
        assert beside.axes[-1].get_legend() is not None

    def test_what_does_not_belong_together_is_refused(self) -> None:
        with pytest.raises(ValueError, match=r"evaluations must be of one search, got pond, fog"):
            plots.success_over_time([made_up("planner"), made_up("planner", "fog")])
        for draw in (plots.success_over_time, plots.suite_over_time, plots.success_by_search):
            with pytest.raises(ValueError, match=r"evaluations must be at least one, got none"):
                draw([])
        with pytest.raises(ValueError, match=r"columns must be an integer of at least 1, got 0"):
            plots.suite_over_time([made_up("planner")], columns=0)


class TestNames:
    @given(st.lists(st.floats(0.0, 1.0), min_size=1, max_size=12), st.floats(0.01, 0.3))
    def test_they_are_apart_in_order_and_inside(self, values: list[float], gap: float) -> None:
        places = plots._apart(values, gap, 0.0, 1.0)
        assert min(places) >= -1e-9
        assert max(places) <= 1.0 + 1e-9
        kept = min(gap, 1.0 / max(len(values) - 1, 1))
        ranked = [place for _, place in sorted(zip(values, places, strict=True))]
        for below, above in pairwise(ranked):
            assert above - below >= kept - 1e-9

    def test_those_with_room_stay_where_they_are(self) -> None:
        assert plots._apart([0.9, 0.1, 0.5], 0.1, 0.0, 1.0) == pytest.approx([0.9, 0.1, 0.5])

    def test_those_without_share_the_shift(self) -> None:
        assert plots._apart([0.5, 0.5, 0.9], 0.1, 0.0, 1.0) == pytest.approx([0.45, 0.55, 0.9])

    @pytest.mark.parametrize(
        ("limit", "steps"),
        [
            (100, [0, 25, 50, 75, 100]),
            (150, [0, 50, 100, 150]),
            (25, [0, 5, 10, 15, 20, 25]),
            (14, [0, 7, 14]),
            (7, [0, 7]),
        ],
    )
    def test_the_limit_is_marked(self, limit: int, steps: list[int]) -> None:
        assert plots._steps_to_mark(limit) == steps


class TestDots:
    def test_a_dot_stands_where_the_success_is(self) -> None:
        several = [
            made_up(policy, search, share=share, bound=bound)
            for search, bound in (("fog", 0.9), ("pond", 0.8))
            for policy, share in (("planner", 0.75), ("random", 0.25))
        ]
        figure = plots.success_by_search(several)
        (axes,) = figure.axes
        dots = [(line.get_xdata()[0], line.get_ydata()[0]) for line in axes.lines]
        assert [x for x, _ in dots] == [0.75, 0.25, 0.75, 0.25]
        assert [round(y) for _, y in dots] == [0, 0, 1, 1]
        assert [label.get_text() for label in axes.get_yticklabels()] == ["fog", "pond"]
        ends = [bar.get_segments()[0] for bar in axes.collections]
        bounds = [segment[0, 0] for segment in ends if segment[0, 0] == segment[1, 0]]
        assert bounds == [0.9, 0.8]
        bars = [segment[:, 0].tolist() for segment in ends if segment[0, 0] != segment[1, 0]]
        assert bars == [[each.success.low, each.success.high] for each in several]


class TestEpisode:
    def test_tracks_searches_and_persons_are_those_of_the_episode(self) -> None:
        past = [after for _, after in frames("greedy-posterior", "harbour", seed=2)]
        figure = plots.episode("greedy-posterior", "harbour", seed=2)
        left, right = figure.axes[:2]
        *_, (prior, posterior) = frames("greedy-posterior", "harbour", seed=2)
        for axes, frame in ((left, prior), (right, posterior)):
            assert np.array_equal(axes.images[0].get_array(), frame.matrix)
            tracks = [line.get_xydata() for line in axes.lines if len(line.get_xdata()) > 1]
            for drone in range(2):
                track = [past_frame.drones[drone] for past_frame in past]
                assert any(np.array_equal(track, each) for each in tracks)
                looked = [f.drones[drone] for f in past if f.searching[drone]]
                assert any(np.array_equal(looked, each) for each in tracks)
            person = [past_frame.persons[0] for past_frame in past]
            assert any(np.array_equal(person, each) for each in tracks)
        told = f"greedy-posterior searching harbour, seed 2: {outcome_in_brief(past[-1])}"
        assert told in words(figure)

    def test_a_step_in_the_middle_can_be_shown(self) -> None:
        figure = plots.episode("random", "pond", seed=1, step=5, name="chance")
        assert "chance searching pond, seed 1, step 5 of 40" in words(figure)
        for place, (_, frame) in enumerate(frames("random", "pond", seed=1)):
            if place == 5:
                assert np.array_equal(figure.axes[1].images[0].get_array(), frame.matrix)
                break

    def test_bad_input_is_refused(self) -> None:
        with pytest.raises(ValueError, match=r"step must be an integer of at least 0, got -1"):
            plots.episode("random", "pond", step=-1)
        with pytest.raises(ValueError, match=r"search must be one of the suite's"):
            plots.episode("random", "pnd")


class TestReliability:
    def test_points_are_promise_and_outcome(self) -> None:
        shown = {
            "prior": table((0.04, 200, 4), (0.3, 100, 10)),
            "posterior": table((0.03, 100, 3), (0.15, 0, 0), (0.003, 40, 0)),
        }
        figure = plots.reliability(shown)
        (axes,) = figure.axes
        points = [
            (float(line.get_xdata()[0]), float(line.get_ydata()[0]))
            for line in axes.lines
            if len(line.get_xdata()) == 1 and line.get_marker() != "v"
        ]
        assert points == [
            pytest.approx(point) for point in ((0.04, 0.02), (0.3, 0.1), (0.03, 0.03))
        ]
        (never,) = [line for line in axes.lines if line.get_marker() == "v"]
        assert float(never.get_xdata()[0]) == pytest.approx(0.003)
        assert 0.0 < float(never.get_ydata()[0]) < 0.1
        error = (200 * 0.02 + 100 * 0.2) / 300
        assert f"prior (mean error {100 * error:.2f}%)" in words(figure)

    def test_without_searches_there_is_nothing_to_show(self) -> None:
        with pytest.raises(ValueError, match=r"tables must hold at least one search, got \['a'\]"):
            plots.reliability({"a": Reliability.empty()})


class TestFiles:
    def test_pictures_are_of_200_dots_per_inch_and_always_the_same(self, tmp_path: Path) -> None:
        figure = plots.success_over_time([made_up("planner", bound=0.9), made_up("random")])
        png, svg = plots.save(figure, tmp_path / "new" / "curves")
        assert (png.name, svg.name) == ("curves.png", "curves.svg")
        with Image.open(png) as picture:
            assert picture.size == (700, 500)
        again = plots.success_over_time([made_up("planner", bound=0.9), made_up("random")])
        for one, other in zip((png, svg), plots.save(again, tmp_path / "again"), strict=True):
            assert one.read_bytes() == other.read_bytes()

    def test_the_users_own_style_changes_nothing_and_is_left_alone(self, tmp_path: Path) -> None:
        import matplotlib

        plain = plots.save(plots.success_over_time([made_up("planner")]), tmp_path / "a")
        with matplotlib.rc_context({"font.size": 20, "lines.linewidth": 9}):
            own = plots.save(plots.success_over_time([made_up("planner")]), tmp_path / "b")
            assert matplotlib.rcParams["font.size"] == 20
        assert plain[1].read_bytes() == own[1].read_bytes()

    def test_a_file_that_cannot_be_written_is_named(self, tmp_path: Path) -> None:
        (tmp_path / "file").touch()
        figure = plots.success_over_time([made_up("planner")])
        with pytest.raises(StorageError, match=r"curves\.png"):
            plots.save(figure, tmp_path / "file" / "curves")

    def test_pyplot_and_its_global_state_are_not_used(self) -> None:
        code = (
            "import sys; from DroneSwarmSearch.evaluation import plots;"
            "plots.episode('random', 'pond'); sys.exit('matplotlib.pyplot' in sys.modules)"
        )
        assert subprocess.run([sys.executable, "-c", code], check=False).returncode == 0

    def test_without_matplotlib_a_hint_tells_what_to_install(
        self, monkeypatch: pytest.MonkeyPatch
    ) -> None:
        monkeypatch.setitem(sys.modules, "matplotlib", None)
        monkeypatch.delitem(sys.modules, "DroneSwarmSearch.evaluation.plots")
        with pytest.raises(ImportError, match=r"DroneSwarmSearchEnvironment\[evaluation\]"):
            importlib.import_module("DroneSwarmSearch.evaluation.plots")
