"""Plots of evaluations show the measured values."""

import re
from typing import Any

import numpy as np
import pytest
from helpers import made_evaluation

from DroneSwarmSearch import Scenario
from DroneSwarmSearch.evaluation import SUITE, evaluate

pytest.importorskip("matplotlib")


from DroneSwarmSearch.evaluation import plots


def evaluation(policy, search="pond", *, share=0.5, bound=None):
    """40 episodes, of which a share succeeds, each in a different step."""
    where = SUITE[search]
    found = np.arange(1, 41)[:, None]
    found = np.where(found <= round(share * 40), found, 0)
    found = found.repeat(len(where.scenario.persons_to_find), axis=1)
    return made_evaluation(found, where, policy=policy, bound=bound)


TWO = [evaluation("planner", bound=0.9), evaluation("random")]


def texts(figure: Any) -> str:
    """All text in a figure."""
    from matplotlib.text import Text

    return "\n".join(each.get_text() for each in figure.findobj(Text))


def test_each_policy_has_the_mean_curve_of_all_searches():
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
        pond, fog = (each.success_by_time for each in several if each.policy == name)
        assert line.get_ydata()[0] == 0.0
        assert line.get_ydata()[50] == (pond[20] + fog[50]) / 2  # half of 40 and of 100 steps
        assert line.get_ydata()[-1] == (pond[-1] + fog[-1]) / 2
        assert line.get_xdata()[[0, -1]].tolist() == [0.0, 1.0]


def test_rows_show_success_interval_and_bound():
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


def test_equal_plots_make_equal_files_in_both_themes(tmp_path):
    import matplotlib

    files = plots.save(plots.success_by_search, TWO, tmp_path / "new" / "curves")
    assert [path.name for path in files] == [
        "curves-light.svg",
        "curves-dark.svg",
        "curves.png",
        "curves.pdf",
    ]
    with matplotlib.rc_context({"font.size": 20, "lines.linewidth": 9}):  # of the user
        again = plots.save(plots.success_by_search, TWO, tmp_path / "again")
        assert matplotlib.rcParams["font.size"] == 20
    colours = ("#d55e00", "#ff8f4d")  # of the planner
    for one, other in zip(files, again, strict=True):
        assert one.read_bytes() == other.read_bytes()
    assert files[2].read_bytes().startswith(b"\x89PNG")
    assert files[3].read_bytes().startswith(b"%PDF")
    for one, colour in zip(files, colours, strict=False):
        text = one.read_text("utf-8")
        assert colour in text
        assert "<text" not in text  # glyphs are paths, independent of fonts
        (width,) = re.findall(r'<svg [^>]*width="([\d.]+)pt"', text)
        assert 9.5 * 358 / float(width) > 9.0  # legible on a phone of 390 pixels


def test_labels_name_the_measure_of_the_mission():
    rescue = evaluation("planner")
    scenario = rescue.search.scenario.replace(mission="coverage")
    coverage = evaluate("parallel-sweep", scenario, episodes=2)
    curves = plots.success_over_time([coverage])
    assert curves.axes[0].get_ylabel() == "POS"
    assert curves.axes[0].lines[0].get_ydata()[-1] == coverage.success_by_time[-1]
    assert plots.success_over_time([rescue]).axes[0].get_ylabel() == "found"
    both = [rescue, coverage]
    assert plots.success_over_time(both).axes[0].get_ylabel() == "found, or POS"
    label = plots.success_by_search(both).axes[0].get_xlabel()
    assert label == "every person found, or probability of success"


def test_dollar_signs_in_names_are_no_formulas(tmp_path):
    hostile = evaluate("random", Scenario(5), episodes=2, name="$x_$ and $\\frac{", progress=False)
    for draw in (plots.success_by_search, plots.success_over_time):
        assert len(plots.save(draw, [hostile], tmp_path / draw.__name__)) == 4
