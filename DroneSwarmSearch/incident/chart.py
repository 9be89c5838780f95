"""The map of a flight plan, on a page of A4 that is legible in black and white."""

from __future__ import annotations

import io
from datetime import datetime, timedelta
from pathlib import Path
from textwrap import fill
from typing import TYPE_CHECKING, Any

import numpy as np

from DroneSwarmSearch._internal.arrays import Floats
from DroneSwarmSearch._internal.files import write_bytes
from DroneSwarmSearch.evaluation.plots import STYLES
from DroneSwarmSearch.incident import units
from DroneSwarmSearch.rendering.palette import INK, drone_colour, readable_on

if TYPE_CHECKING:
    from matplotlib.figure import Figure

    from DroneSwarmSearch.incident.flight_plan import FlightPlan

PAGE, SHEET = np.array([[595.0, 842.0], [515.0, 580.0]])  # the page and the map, in points
DASHES = (9, 0), (5, 1.6), (1.2, 1), (7, 1.4, 1.2, 1.4), (2.6, 1.2), (7, 1.4, 1.2, 1.4, 1.2, 1.4)
STEPS = np.array([0.1, 0.2, 0.5, 1, 2, 5, 10, 20, 30, 60, 120, 300, 600, 1800])
HEAD = {"arrowstyle": "-|>,head_length=.5,head_width=.25", "linewidth": 0, "shrinkB": 0}
BLACK = {"arrowstyle": "simple", "color": "black", "shrinkB": 0}
BOX = {"facecolor": "white", "edgecolor": "none", "boxstyle": "round,pad=.1"}
SIGN: Any = {"color": "black", "linestyle": "", "markersize": 10}
CENTRED = {"ha": "center", "va": "center_baseline", "fontsize": 7.5}
STYLE = {
    "axes.grid": True,
    "font.size": 8,
    "legend.frameon": False,
    "lines.markeredgecolor": "auto",
    "svg.hashsalt": "DroneSwarmSearch",  # equal maps make equal files
}


def save(plan: FlightPlan, folder: Path) -> None:
    """Write the map to a folder, as `map.png`, 1,322 pixels wide, and as `map.svg`."""
    from matplotlib import style

    with style.context(["default", STYLES / "light.mplstyle", STYLE]):
        figure = draw(plan)
        for kind, metadata in (("png", {}), ("svg", {"Date": None, "Creator": None})):
            content = io.BytesIO()
            figure.savefig(content, format=kind, dpi=160, metadata=metadata)
            write_bytes(folder / f"map.{kind}", content.getvalue())


def draw(plan: FlightPlan) -> Figure:
    """Draw the drones' tracks over the areas where the person may be; north is up.

    Lines enclose the smallest areas that hold 50% and 90% of the probability if nobody searches,
    dashed when the search begins and solid at the last landing. The grey is the map at the start.
    """
    from matplotlib.figure import Figure
    from matplotlib.patheffects import Normal, Stroke

    incident, scale, steps = plan.incident, plan.search.scale, len(plan.success) - 1
    assert scale is not None and incident.position is not None
    start = min(each.time for each in plan.waypoints)
    end = plan.first + timedelta(seconds=scale.seconds(steps))
    tracks = [incident.cell_of(*np.array([each[2:4] for each in one]).T) for one in plan.flights]
    known, base, cell = incident.cell_of(*incident.position), tracks[0][0], scale.metres_per_cell
    maps = {plan.first: plan.prior(0), end: plan.prior(steps)}
    figure = Figure(PAGE / 72)
    axes: Any = figure.add_axes((50 / PAGE[0], 165 / PAGE[1], *SHEET / PAGE))
    means = _areas(axes, maps)
    # The map shows the areas, and everything else that is on the grid.
    cells, half = np.vstack([*tracks, known]), len(maps[end]) / 2
    shown = [cells[(abs(cells - half + 0.5) < half).all(axis=1)]]
    shown += [np.argwhere(mass > _level(mass, 0.9))[:, ::-1] for mass in maps.values()]
    low, high = (edge(np.vstack(shown), axis=0) for edge in (np.min, np.max))
    point = 1.1 * ((high - low + 2) / SHEET).max()  # in cells
    (left, top), (right, bottom) = ((low + high + way * point * SHEET) / 2 for way in (-1, 1))
    axes.set(xlim=(left, right), ylim=(bottom, top))
    _graticule(axes, incident.locate)
    arrow = {"arrowstyle": "simple,head_width=.8,tail_width=.3", "facecolor": "white"}
    axes.annotate("", means[1], means[0], arrowprops=arrow | {"shrinkA": 0, "shrinkB": 0}, zorder=6)
    drift = f"mean drift {_course(cell * (means[1] - means[0]))}"
    axes.plot([], [], marker=r"$\Rightarrow$", label=drift, **SIGN)
    axes.plot([], [], marker="$10$", label=f"minutes since {start:%H:%M}", **SIGN)
    up = 9 if known[1] <= base[1] else -9  # the name of the northern place above it
    _place(axes, known, "oP", f"last known position, {incident.time:%H:%M}", up, cell)
    _place(axes, base, "s", f"take-off, {start:%H:%M}", -up, cell)

    flown = [[(each.time - start).total_seconds() / 60 for each in one] for one in plan.flights]
    step = STEPS[STEPS.searchsorted(sum(each[-1] - each[0] for each in flown) / 40)]
    gap = 50 * point * cell / incident.speed / 60  # minutes between heads of arrows
    marked = [known, base]
    for drone, (track, minutes) in enumerate(zip(tracks, flown, strict=True)):
        disc = drone_colour(drone)
        colour, ink, white = (np.array(each) / 255 for each in (disc, INK, readable_on(disc)))
        dashes = (0, DASHES[drone % len(DASHES)])
        casing = [Stroke(linewidth=2.6, foreground=ink), Normal()]
        look: Any = {"color": colour, "path_effects": casing}
        first = [each.searching for each in plan.flights[drone]].index(True)
        axes.plot(*track[: first + 1].T, color=ink, linewidth=0.7)
        axes.plot(*track[first:].T, linestyle=dashes, label=f"drone {drone}", **look)
        for time in np.arange(minutes[0] + gap, minutes[-1], gap):
            tail, tip = _between(track, minutes, [time - gap / 20, time + gap / 20])
            axes.annotate("", tip, tail, arrowprops=HEAD | {"color": ink})
        look = {"zorder": 8, "clip_on": True, **CENTRED}
        circle = {"boxstyle": "circle", "facecolor": colour, "edgecolor": ink}
        clear = [at for at in track[first:] if np.abs(at - marked).max(axis=1).min() > 12 * point]
        place = clear[0] if clear else track[first]
        axes.text(*place, f"{drone}", bbox=circle, color=white, **{**look, "zorder": 10})
        marked.append(place)
        times = np.arange(np.ceil(minutes[0] / step), minutes[-1] / step) * step
        for time, at in zip(times, _between(track, minutes, times), strict=True):
            if np.abs(at - marked).max(axis=1).min() > 12 * point:
                axes.text(*at, f"{time:g}", bbox=BOX, **look)
                marked.append(at)

    axes.legend(loc="upper left", bbox_to_anchor=(0, -0.1), ncols=3, handlelength=4, borderpad=0)
    look = {"transform": axes.get_xaxis_transform(), "clip_on": False}
    for y, metres, unit in ((-0.055, 1000, "km"), (-0.08, 1852, "NM")):
        length = STEPS[STEPS.searchsorted(150 * point * cell / metres) - 1]
        x = left + np.linspace(0, length * metres / cell, 3)
        axes.plot(x, [y, y, y], "k|-", **look)
        axes.text(x[2] + 5 * point, y, f"{length:g} {unit}", va="center", **look)
    look = {"xycoords": "axes fraction", "annotation_clip": False, "ha": "center"}
    axes.annotate("N", (0.98, -0.03), (0.98, -0.11), arrowprops=BLACK, **look)
    title = f"{incident.object_class or 'Tracks'}: probability of success {plan.success[-1]:.0%}"
    look = {"fontsize": 14, "weight": "bold"}
    axes.set_title(f"{title} by {end:%H:%M} UTC", loc="left", pad=34, **look)
    look = {"transform": axes.transAxes, "va": "top", "fontsize": 7.5}
    axes.text(0, 1.045, fill(plan.search.reason, 130), **look)
    assumptions = (
        f"Cells of {cell:g} m; swath {incident.swath:g} m; probability of detection "
        f"{incident.probability_of_detection:g}; {incident.speed:g} m/s. Areas and grey: where the "
        "person may be if nobody searches. Times are UTC."
    )
    axes.text(0, -0.23, fill(assumptions, 130), **look)
    return figure


def _areas(axes: Any, maps: dict[datetime, Floats]) -> list[Floats]:
    """Draw the first map, and the areas of both; return their mean cells (x, y)."""
    means: list[Floats] = []
    for (time, mass), dashes in zip(maps.items(), ("--", "-"), strict=True):
        if not means:
            axes.imshow(mass, "Greys", vmax=3 * mass.max(), interpolation="bilinear", zorder=0)
        look: Any = {"linestyles": dashes, "linewidths": 0.9, "zorder": 3}
        for share in (50, 90):
            lines = axes.contour(mass, [_level(mass, share / 100)], colors="0.2", **look)
            line = np.vstack(lines.allsegs[0])
            # In the north at the start and in the south at the end, so that labels lie apart.
            at = line[line[:, 1].argmax() if means else line[:, 1].argmin()]
            axes.clabel(lines, fmt=f"{share}%%", fontsize=7.5, manual=[at])
        label = f"50% and 90% areas at {time:%H:%M}"
        axes.plot([], [], dashes, color="0.2", linewidth=0.9, label=label)
        numbers, total = np.arange(len(mass)), mass.sum()
        means.append(np.array([mass.sum(axis=0) @ numbers, mass.sum(axis=1) @ numbers]) / total)
    return means


def _graticule(axes: Any, locate: Any) -> None:
    """Put ticks and lines at round minutes of latitude and longitude."""
    (left, right), (bottom, top) = axes.get_xlim(), axes.get_ylim()
    x, y = (left + right) / 2, (bottom + top) / 2
    places = locate([(x, bottom), (x, top), (left, y), (right, y)])
    places[:, 1] -= 360 * np.round((places[:, 1] - places[0, 1]) / 360)  # at the date line
    for axis, cells, letters, (first, last) in (
        (axes.yaxis, (bottom, top), "NS", 60 * places[:2, 0]),
        (axes.xaxis, (left, right), "EW", 60 * places[2:, 1]),
    ):
        span = last - first
        step = STEPS[STEPS.searchsorted(span / 6)]
        minutes = np.arange(np.ceil((first + span / 20) / step), (last - span / 20) / step) * step
        names = [units.minutes(each, letters) for each in minutes]
        axis.set_ticks(np.interp(minutes, (first, last), cells), names)
    axes.tick_params(axis="y", labelrotation=90)


def _place(axes: Any, at: Floats, symbols: str, name: str, up: int, cell: float) -> None:
    """Draw symbols and a name, or an arrow at the edge towards a place off the map."""
    (left, right), (bottom, top) = axes.get_xlim(), axes.get_ylim()
    middle = np.array([left + right, bottom + top]) / 2
    away = 2 * (at - middle) / (right - left, bottom - top)
    if (beyond := abs(away).max()) > 1:
        tip, tail = (middle + (at - middle) * share / beyond for share in (0.99, 0.89))
        axes.annotate("", tip, tail, arrowprops=BLACK | {"shrinkA": 0}, zorder=9)
        label = f"{name}: {_course(cell * (at - tip))}"
        axes.plot([], [], marker=r"$\rightarrow$", label=label, **SIGN)
        return
    for symbol in symbols:
        axes.plot(*at, f"k{symbol}", markerfacecolor="white", markersize=9, zorder=9)
    look: Any = {"va": "center", "bbox": BOX, "zorder": 9}
    look["ha"], offset = ("left", (9, up)) if away[0] < 0 else ("right", (-9, up))
    axes.annotate(name, at, offset, textcoords="offset points", **look)


def _course(metres: Floats) -> str:
    """A distance and a direction, from an offset in metres to the right and down."""
    length, degrees = np.hypot(*metres), np.degrees(np.arctan2(metres[0], -metres[1])) % 360
    return f"{length / 1000:.1f} km ({length / 1852:.1f} NM), {degrees:03.0f}°"


def _level(mass: Floats, share: float) -> float:
    """The probability at the edge of the smallest area that holds a share of a map."""
    ordered = np.append(np.sort(mass, axis=None)[::-1], 0.0)
    last = int((ordered.cumsum() < share * ordered.sum()).sum())
    return 0.4999 * float(ordered[last] + ordered[last + 1])  # below the likeliest cells


def _between(track: Floats, times: Any, at: Any) -> Floats:
    """The points of a track at other times, (n, 2)."""
    return np.stack([np.interp(at, times, each) for each in track.T], axis=-1)
