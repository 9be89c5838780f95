"""Plots of evaluations show the measured values."""

from __future__ import annotations

import re
import subprocess
import sys
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from helpers import bound_by_time

from DroneSwarmSearch.evaluation import SUITE, Episodes, Evaluation, StorageError, View, evaluate
from DroneSwarmSearch.evaluation.episodes import Reliability

pytest.importorskip("matplotlib")

from matplotlib.colors import to_hex, to_rgb

from DroneSwarmSearch.evaluation import plot_style, plots


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
    at = np.where(found[:, :1] > 0, found[:, :1], np.inf)
    curves = (np.arange(limit + 1) >= at) * 1.0
    steps = np.full(n, limit)
    episodes = Episodes(found, endings, steps, np.zeros(n), Reliability.empty(), curves)
    upper = None
    if bound is not None:
        upper = bound_by_time(np.linspace(0.0, bound, limit + 1))
    return Evaluation(policy, where, 0, View(), episodes, False, upper)


def draw(theme: Any) -> Any:
    """A plot of two policies."""
    several = [evaluation("planner", bound=0.9), evaluation("random")]
    return plots.success_by_search(several, theme)


def texts(figure: Any) -> str:
    """All text in a figure."""
    from matplotlib.text import Text

    return "\n".join(each.get_text() for each in figure.findobj(Text))


class TestCurves:
    def test_each_policy_has_the_mean_curve_of_all_searches(self) -> None:
        several = [
            evaluation(policy, search, share=share)
            for search, factor in (("pond", 1.0), ("fog", 0.5))
            for policy, share in (("random", 0.1 * factor), ("planner", 0.9 * factor))
        ]
        figure = plots.success_over_time(several)
        (axes,) = figure.axes
        (legend,) = figure.legends
        assert [each.get_text() for each in legend.texts] == ["planner 67.5%", "random 7.5%"]
        for line, name in zip(axes.lines, ("planner", "random"), strict=True):
            pond, fog = (each.success_by_time.value for each in several if each.policy == name)
            assert line.get_ydata()[0] == 0.0
            assert line.get_ydata()[50] == (pond[20] + fog[50]) / 2  # half of 40 and of 100 steps
            assert line.get_ydata()[-1] == (pond[-1] + fog[-1]) / 2
            assert line.get_xdata()[[0, -1]].tolist() == [0.0, 1.0]

    def test_the_mean_bound_is_a_dashed_line(self) -> None:
        several = [evaluation("planner", "pond", bound=0.75), evaluation("planner", "fog", bound=1)]
        figure = plots.success_over_time(several)
        bound, curve = figure.axes[0].lines
        assert bound.is_dashed()
        assert not curve.is_dashed()
        assert {*bound.get_ydata()} == {0.875}
        assert "bound 87.5%" in texts(figure)
        assert "bound" not in texts(plots.success_over_time([*several, evaluation("ppo", "gale")]))

    @pytest.mark.parametrize("theme", [plot_style.LIGHT, plot_style.DARK])
    def test_a_policy_looks_the_same_in_every_plot(self, theme: Any) -> None:
        alone = plots.success_over_time([evaluation("random", share=0.1)], theme)
        names = ("mine", "planner", "random")
        shares = dict(zip(names, (0.9, 0.5, 0.1), strict=True))
        last = plots.success_over_time([evaluation(n, share=shares[n]) for n in names], theme)
        colours = [to_hex(figure.axes[0].lines[-1].get_color()) for figure in (alone, last)]
        assert colours == [theme.looks["random"].colour] * 2
        assert len({to_hex(line.get_color()) for line in last.axes[0].lines}) == 3

    @pytest.mark.parametrize("theme", [plot_style.LIGHT, plot_style.DARK])
    def test_all_looks_differ_and_stand_out(self, theme: Any) -> None:
        looks = [*theme.looks.values(), *theme.others]
        assert len({look.colour for look in looks}) == len(looks)
        assert len({look.marker for look in looks}) == len(looks)
        assert list(theme.looks) == list(plot_style.LIGHT.looks)
        for look in looks:  # WCAG asks for a contrast of 3; light colours on white stay below
            assert contrast(look.colour, theme.ground) > (1.9 if theme.name == "light" else 4.5)

    def test_no_evaluations_are_refused(self) -> None:
        for draw in (plots.success_over_time, plots.success_by_search):
            with pytest.raises(ValueError, match=r"evaluations must be at least one, got none"):
                draw([])


def contrast(one: str, other: str) -> float:
    """The contrast of two colours as WCAG defines it, from 1 to 21."""

    def luminance(colour: str) -> float:
        linear = [((c + 0.055) / 1.055) ** 2.4 if c > 0.04 else c / 12.92 for c in to_rgb(colour)]
        return float(np.dot((0.2126, 0.7152, 0.0722), linear))

    darker, lighter = sorted((luminance(one), luminance(other)))
    return (lighter + 0.05) / (darker + 0.05)


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


class TestFiles:
    def test_equal_plots_make_equal_files_in_both_themes(self, tmp_path: Path) -> None:
        files = plot_style.save(draw, tmp_path / "new" / "curves")
        assert [path.name for path in files] == ["curves-light.svg", "curves-dark.svg"]
        for one, other in zip(files, plot_style.save(draw, tmp_path / "again"), strict=True):
            assert one.read_bytes() == other.read_bytes()
        for path, theme in zip(files, (plot_style.LIGHT, plot_style.DARK), strict=True):
            text = path.read_text("utf-8")
            assert theme.ground in text and theme.looks["planner"].colour in text
            assert "<text" not in text  # glyphs are paths, independent of fonts

    def test_text_is_legible_on_a_phone(self, tmp_path: Path) -> None:
        """A page of 390 pixels leaves 358 for a plot."""
        for path in plot_style.save(draw, tmp_path / "curves"):
            (width,) = re.findall(r'<svg [^>]*width="([\d.]+)pt"', path.read_text("utf-8"))
            assert 9.5 * 358 / float(width) > 9.0

    def test_the_users_settings_have_no_effect_and_stay(self, tmp_path: Path) -> None:
        import matplotlib

        plain = plot_style.save(draw, tmp_path / "a")
        with matplotlib.rc_context({"font.size": 20, "lines.linewidth": 9}):
            own = plot_style.save(draw, tmp_path / "b")
            assert matplotlib.rcParams["font.size"] == 20
        assert plain[1].read_bytes() == own[1].read_bytes()

    def test_a_file_that_cannot_be_written_is_named(self, tmp_path: Path) -> None:
        (tmp_path / "file").touch()
        with pytest.raises(StorageError, match=r"curves-light\.svg"):
            plot_style.save(draw, tmp_path / "file" / "curves")

    def test_pyplot_is_not_imported(self, tmp_path: Path) -> None:
        code = (
            "import sys; from matplotlib.figure import Figure;"
            "from DroneSwarmSearch.evaluation import plot_style, plots;"
            f"plot_style.save(lambda theme: Figure(), {str(tmp_path / 'empty')!r});"
            "sys.exit('matplotlib.pyplot' in sys.modules)"
        )
        assert subprocess.run([sys.executable, "-c", code], check=False).returncode == 0

    def test_without_matplotlib_there_is_a_hint(self) -> None:
        code = (
            "import importlib, sys\n"
            "sys.modules['matplotlib'] = None\n"
            "try:\n"
            "    importlib.import_module('DroneSwarmSearch.evaluation.plots')\n"
            "except ImportError as error:\n"
            "    print(error)\n"
        )
        done = subprocess.run(
            [sys.executable, "-c", code], capture_output=True, text=True, check=True
        )
        assert done.stdout.count("DroneSwarmSearchEnvironment[evaluation]") == 1


def test_labels_name_the_measure_of_the_mission() -> None:
    rescue = evaluation("planner")
    scenario = rescue.search.scenario.replace(mission="coverage")
    coverage = evaluate("parallel-sweep", scenario, episodes=2)
    curves = plots.success_over_time([coverage])
    assert curves.axes[0].get_ylabel() == "POS"
    assert curves.axes[0].lines[0].get_ydata()[-1] == coverage.success_by_time.value[-1]
    assert plots.success_over_time([rescue]).axes[0].get_ylabel() == "found"
    both = [rescue, coverage]
    assert plots.success_over_time(both).axes[0].get_ylabel() == "found, or POS"
    label = plots.success_by_search(both).axes[0].get_xlabel()
    assert label == "every person found, or probability of success"
