"""Maps of one episode, with the prior and the posterior."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

# First, since its error explains how to install Matplotlib.
from DroneSwarmSearch.evaluation.plot_style import DOUBLE, GREY, INK, LOOKS, styled

# isort: split

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.lines import Line2D
from matplotlib.ticker import MaxNLocator, PercentFormatter

from DroneSwarmSearch._internal import checks
from DroneSwarmSearch.evaluation.policy_spec import PolicySpec
from DroneSwarmSearch.evaluation.recording import frames
from DroneSwarmSearch.evaluation.suite import as_named
from DroneSwarmSearch.rendering.frame import Frame
from DroneSwarmSearch.rendering.labels import outcome_in_brief

__all__ = ["episode"]

TRACKS = [look.colour for look in LOOKS.values()]


@styled
def episode(
    policy: object,
    search: object,
    *,
    seed: int = 0,
    step: int | None = None,
    name: str | None = None,
) -> Figure:
    """Draw one episode as two maps: the prior on the left, the posterior on the right.

    Both show every drone's track, the cells it searched, and, if the mission is to find persons,
    the track of each, which the drones do not see.

    Args:
        policy: as for `evaluate`; a callable sees one search, as `DroneSwarmSearch` shows it.
        search: the name of a search of the suite, a `NamedSearch`, or a `Scenario`.
        seed: of the episode, an integer >= 0.
        step: the step to show; None, or a step after the end, shows the last.
        name: the policy's name in the picture.

    Raises:
        TypeError: an argument is of the wrong type.
        ValueError: an argument is out of range, or a name is unknown.
    """
    spec, where = PolicySpec.of(policy, name), as_named(search)
    last = None if step is None else checks.integer("step", step, 0)
    pairs = []
    for pair in frames(spec, where, seed=seed):
        pairs.append(pair)
        if pair[1].step == last:
            break
    now = pairs[-1][1]
    state = f", step {now.step} of {now.timestep_limit}"
    if now.ending is not None:
        state = f": {outcome_in_brief(now)}"
    figure = Figure(figsize=(DOUBLE, 3.75))
    figure.suptitle(f"{spec.name} searching {where.name}, seed {seed}{state}", fontweight="bold")
    panels = figure.subplots(1, 2)
    for axes, frame, title in zip(panels, pairs[-1], ("prior", "posterior"), strict=True):
        image = axes.imshow(frame.matrix, vmin=0.0, alpha=0.6)  # pale, so that tracks stand out
        figure.colorbar(image, ax=axes, format=PercentFormatter(1.0), shrink=0.8)
        axes.set(title=title, xlabel="x", ylabel="y")
        axes.grid(visible=False)
        for axis in (axes.xaxis, axes.yaxis):
            axis.set_major_locator(MaxNLocator(6, integer=True))
        _draw_tracks(axes, [posterior for _, posterior in pairs])
    _track_legend(figure, has_persons=bool(now.persons))
    return figure


MARKERS: dict[str, dict[str, Any]] = {
    "start": {"marker": "o", "fillstyle": "none", "markeredgewidth": 0.9},
    "searched": {"marker": "o", "markersize": 3},
    "drone": {"marker": "X", "markersize": 6},
    "person": {"marker": "*", "markersize": 8},
}
PERSON_TRACK: dict[str, Any] = {"color": INK, "linewidth": 0.8, "linestyle": ":"}


def _marker(kind: str, colour: str) -> dict[str, Any]:
    """How to draw markers of one colour; those of the start are hollow."""
    edge = "markeredgecolor" if kind == "start" else "color"
    return {"linestyle": "none", **MARKERS[kind], edge: colour}


def _draw_tracks(axes: Axes, past: Sequence[Frame]) -> None:
    """Draw what the drones did until now, and the persons."""
    for drone in range(len(past[0].drones)):
        colour = TRACKS[drone % len(TRACKS)]
        track = np.array([frame.drones[drone] for frame in past])
        searched = track[[frame.searching[drone] for frame in past]]
        axes.plot(*track.T, color=colour, linewidth=0.9)
        axes.plot(*track[:1].T, **_marker("start", colour))
        axes.plot(*searched.T, **_marker("searched", colour))
        axes.plot(*track[-1:].T, **_marker("drone", colour))
    for person in range(len(past[0].persons)):
        track = np.array([frame.persons[person] for frame in past])
        axes.plot(*track.T, **PERSON_TRACK)
        axes.plot(*track[-1:].T, **_marker("person", INK))


def _track_legend(figure: Figure, has_persons: bool) -> None:
    entries = [Line2D([], [], color=GREY, linewidth=0.9, label="drone's track")]
    kinds = [kind for kind in MARKERS if has_persons or kind != "person"]
    entries += [Line2D([], [], **_marker(kind, GREY), label=kind) for kind in kinds]
    if has_persons:
        entries.append(Line2D([], [], **PERSON_TRACK, label="person's track"))
    figure.legend(handles=entries, loc="outside lower center", ncols=len(entries))
