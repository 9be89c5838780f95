"""The map of a flight plan, on a page of A4 that is legible in black and white."""

from __future__ import annotations

import io
from collections.abc import Sequence
from pathlib import Path
from textwrap import fill
from typing import TYPE_CHECKING, Any

import numpy as np

from DroneSwarmSearch._internal.arrays import Floats
from DroneSwarmSearch._internal.extras import import_matplotlib
from DroneSwarmSearch._internal.files import write_bytes
from DroneSwarmSearch._internal.text import without_formulas
from DroneSwarmSearch.geo import units
from DroneSwarmSearch.geo.plane import TangentPlane
from DroneSwarmSearch.geo.units import KNOT
from DroneSwarmSearch.incident.flights import track, up_to_the_minute
from DroneSwarmSearch.incident.planned_flights import PlannedFlights
from DroneSwarmSearch.rendering.palette import INK, drone_colour, readable_on

if TYPE_CHECKING:
    from matplotlib.figure import Figure

PAGE, SHEET = np.array([[595.0, 842.0], [515.0, 470.0]])  # the page and the map, in points
PER_SHEET = 6
"""The most drones whose flights are told apart on a sheet; more are drawn on further sheets."""

WIDER = 1.6  # a place is only on the map if it does not become so many times as wide

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


def save(plan: PlannedFlights, folder: Path) -> None:
    """Write `map.png`, 1,322 pixels wide, and `map.svg`, and perhaps more sheets, `map2.png`..."""
    import_matplotlib("the map needs the package matplotlib", "plan")
    from matplotlib import style

    with style.context(["default", "DroneSwarmSearch.evaluation.light", STYLE]):
        for sheet, first in enumerate(range(0, len(plan.flights), PER_SHEET), 1):
            figure = draw(plan, range(first, min(first + PER_SHEET, len(plan.flights))))
            for kind, metadata in (("png", {}), ("svg", {"Date": None, "Creator": None})):
                content = io.BytesIO()
                figure.savefig(content, format=kind, dpi=160, metadata=metadata)
                name = f"map{sheet if sheet > 1 else ''}.{kind}"
                write_bytes(folder / name, content.getvalue())


def draw(plan: PlannedFlights, drones: Sequence[int]) -> Figure:
    """Draw the flights of some drones over the areas where the person may be; north is up.

    Lines enclose the smallest areas that hold 50% and 90% of the probability if nobody searches,
    dashed when the search begins and solid at the last landing. The grey is the map at the start.
    Each drone's strips have its colour.
    """
    from matplotlib.figure import Figure
    from matplotlib.patheffects import Normal, Stroke

    incident, plane = plan.incident, plan.incident.plane
    start, tracks = incident.start, [track(plan.flights[drone], plane) for drone in drones]
    known, base = plane.metres(*incident.position), plane.metres(*incident.base)
    figure = Figure(PAGE / 72)
    axes: Any = figure.add_axes((50 / PAGE[0], 285 / PAGE[1], *SHEET / PAGE))
    means, boxes = _areas(axes, plan)
    boxes += [edge([edge(line[1:-1], 0) for line in tracks], 0) for edge in (np.min, np.max)]
    for place in (known, base):
        low, high = np.min(boxes, axis=0), np.max(boxes, axis=0)
        if np.all(np.abs(place - (low + high) / 2) < WIDER / 2 * (high - low).max()):
            boxes.append(place)
    low, high = np.min(boxes, axis=0), np.max(boxes, axis=0)
    point = 1.12 * ((high - low) / SHEET).max()  # in metres
    (left, bottom), (right, top) = ((low + high + way * point * SHEET) / 2 for way in (-1, 1))
    axes.set(xlim=(left, right), ylim=(bottom, top))
    _graticule(axes, plane)
    if isinstance(incident.current, str):
        across, along = (np.linspace(*ends, 14)[1:-1] for ends in ((left, right), (bottom, top)))
        grid = np.stack(np.meshgrid(across, along)).reshape(2, -1)
        middle = incident.seconds(plan.on_scene)
        arrows = incident.flow("current", checked=False)(middle, grid)
        fastest = f"{np.nanmax(np.hypot(*arrows)) / KNOT:.1f} kn"
        label = f"current at {up_to_the_minute(plan.on_scene):%H:%M}, up to {fastest}"
        axes.plot([], [], marker=r"$\rightarrow$", label=label, **SIGN | {"color": "0.45"})
        axes.quiver(*grid, *arrows, color="0.45", width=0.0016, pivot="middle", zorder=1)
    arrow = {"arrowstyle": "simple,head_width=.8,tail_width=.3", "facecolor": "white"}
    axes.annotate("", means[1], means[0], arrowprops=arrow | {"shrinkA": 0, "shrinkB": 0}, zorder=6)
    label = f"mean drift {_course(means[1] - means[0])}"
    axes.plot([], [], marker=r"$\Rightarrow$", label=label, **SIGN)
    axes.plot([], [], marker="$10$", label=f"minutes since {up_to_the_minute(start):%H:%M}", **SIGN)
    up = 11 if known[1] >= base[1] else -11  # the name of the northern place above it
    away = f": {_course(base - known)} from there" if np.hypot(*(base - known)) > point else ""
    _place(axes, base, "s", 15, f"take-off, {up_to_the_minute(start):%H:%M}", -up, away)
    _place(axes, known, "oP", 8, f"last known position, {incident.time:%H:%M}", up, "")

    flights = [plan.flights[drone] for drone in drones]
    flown = [[(point.time - start).total_seconds() / 60 for point in flight] for flight in flights]
    step = STEPS[STEPS.searchsorted(sum(times[-1] - times[0] for times in flown) / 30)]
    gap = 60 * point / incident.speed / 60  # minutes between heads of arrows
    marked = [known, base]
    for drone, points, minutes in zip(drones, tracks, flown, strict=True):
        disc = drone_colour(drone)
        colour, ink, white = (np.array(rgb) / 255 for rgb in (disc, INK, readable_on(disc)))
        casing = [Stroke(linewidth=2.4, foreground=ink), Normal()]
        strip: Any = {"color": colour, "alpha": 0.3, "linewidth": incident.swath / point}
        axes.plot(*points[1:-1].T, solid_capstyle="butt", zorder=2, **strip)
        look: Any = {"color": colour, "path_effects": casing, "linewidth": 1.2}
        dashes = (0, DASHES[drone % len(DASHES)])
        axes.plot(*points[:2].T, ":", color=ink, linewidth=0.7)
        axes.plot(*points[-2:].T, ":", color=ink, linewidth=0.7)
        axes.plot(*points[1:-1].T, linestyle=dashes, label=f"drone {drone + 1}", **look)
        for time in np.arange(minutes[1] + gap / 2, minutes[-2], gap):
            tail, tip = _between(points, minutes, [time - gap / 20, time + gap / 20])
            axes.annotate("", tip, tail, arrowprops=HEAD | {"color": ink})
        look = {"zorder": 8, "clip_on": True, **CENTRED}
        circle = {"boxstyle": "circle", "facecolor": colour, "edgecolor": ink}
        axes.text(*points[1], f"{drone + 1}", bbox=circle, color=white, **{**look, "zorder": 10})
        marked.append(points[1])
        times = np.arange(np.ceil(minutes[1] / step), minutes[-2] / step) * step
        for time, at in zip(times, _between(points, minutes, times), strict=True):
            if np.abs(at - marked).max(axis=1).min() > 13 * point:
                axes.text(*at, f"{time:g}", bbox=BOX, **look)
                marked.append(at)

    axes.legend(loc="upper left", bbox_to_anchor=(0, -0.105), ncols=3, handlelength=4, borderpad=0)
    look = {"transform": axes.get_xaxis_transform(), "clip_on": False}
    for y, metres, unit in ((-0.062, 1000, "km"), (-0.09, 1852, "NM")):
        length = STEPS[STEPS.searchsorted(150 * point / metres) - 1]
        x = left + np.linspace(0, length * metres, 3)
        axes.plot(x, [y, y, y], "k|-", **look)
        axes.text(x[2] + 5 * point, y, f"{length:g} {unit}", va="center", **look)
    look = {"xycoords": "axes fraction", "annotation_clip": False, "ha": "center"}
    axes.annotate("N", (0.98, -0.03), (0.98, -0.11), arrowprops=BLACK, **look)
    title = f"{incident.target.partition(' (')[0]}: probability of success"
    look = {"fontsize": 12, "weight": "bold"}
    success = f"{plan.probability_of_success:.0%} by {plan.landed:%H:%M} UTC"
    axes.set_title(_wrapped(f"{title} {success}", 78), loc="left", pad=34, **look)
    look = {"transform": axes.transAxes, "va": "top", "fontsize": 7.5}
    axes.text(0, 1.055, _wrapped(incident.sentence, 130), **look)
    _table(figure, plan, drones)
    text = " ".join(plan.assumptions)
    figure.text(50 / PAGE[0], 24 / PAGE[1], _wrapped(text, 135), va="bottom", fontsize=7.5)
    return figure


def _wrapped(text: str, width: int) -> str:
    """A text in lines of at most so many characters, in which Matplotlib reads no formula."""
    return without_formulas(fill(text, width))


def _table(figure: Figure, plan: PlannedFlights, drones: Sequence[int]) -> None:
    """The orders of the drones, in columns as wide as their longest line."""
    axes = figure.add_axes((50 / PAGE[0], 80 / PAGE[1], SHEET[0] / PAGE[0], 105 / PAGE[1]))
    axes.axis("off")
    rows = [[*plan.order(drone).values()] for drone in drones]
    heads = [fill(name, 13 if name[0] == "c" else 9) for name in plan.order(drones[0])]
    lines = [[*head.splitlines(), *texts] for head, *texts in zip(heads, *rows, strict=True)]
    widths = np.array([max(map(len, line)) + 1.5 for line in lines])
    box: Any = (0, 0.82 - 0.12 * len(rows), 1, 0.18 + 0.12 * len(rows))
    table = axes.table(
        rows,
        colLabels=heads,
        colWidths=widths / widths.sum(),
        bbox=box,
        cellLoc="left",
        colLoc="left",
        edges="horizontal",
    )
    table.auto_set_font_size(False)
    table.set_fontsize(6.3)
    for (row, _), cell in table.get_celld().items():
        cell.PAD = 0.02
        cell.set_height(0.18 if row == 0 else 0.12)


def _areas(axes: Any, plan: PlannedFlights) -> tuple[list[Floats], list[Floats]]:
    """Draw the first map, and the areas at start and end; return means and corners in metres."""
    means: list[Floats] = []
    corners: list[Floats] = []
    for time, shown, dashes in (
        (plan.on_scene, up_to_the_minute(plan.on_scene), "--"),
        (plan.landed, plan.landed, "-"),
    ):
        mass, (west, south), (east, north) = plan.density(time)
        if not means:
            look: Any = {"vmax": 3 * mass.max(), "interpolation": "bilinear", "zorder": 0}
            axes.imshow(mass, "Greys", extent=(west, east, south, north), **look)
        side = (east - west) / len(mass)
        x = west + side * (np.arange(len(mass)) + 0.5)
        y = north - side * (np.arange(len(mass)) + 0.5)
        look = {"linestyles": dashes, "linewidths": 0.9, "zorder": 3}
        for share in (50, 90):
            lines = axes.contour(x, y, mass, [_level(mass, share / 100)], colors="0.2", **look)
            line = np.vstack(lines.allsegs[0])
            # In the north at the start and in the south at the end, so that labels lie apart.
            at = line[line[:, 1].argmin() if means else line[:, 1].argmax()]
            axes.clabel(lines, fmt=f"{share}%%", fontsize=7.5, manual=[at])
        corners += [line.min(axis=0), line.max(axis=0)]
        label = f"50% and 90% areas at {shown:%H:%M}"
        axes.plot([], [], dashes, color="0.2", linewidth=0.9, label=label)
        means.append(plan.particles.mean(plan.incident.seconds(time)))
    axes.set_aspect("auto")
    return means, corners


def _graticule(axes: Any, plane: TangentPlane) -> None:
    """Put ticks and lines at round minutes of latitude and longitude."""
    (left, right), (bottom, top) = axes.get_xlim(), axes.get_ylim()
    x, y = (left + right) / 2, (bottom + top) / 2
    ends = plane.degrees([(x, bottom), (x, top), (left, y), (right, y)])
    ends[:, 1] -= 360 * np.round((ends[:, 1] - ends[0, 1]) / 360)  # at the date line
    for axis, metres, letters, (first, last) in (
        (axes.yaxis, (bottom, top), "NS", 60 * ends[:2, 0]),
        (axes.xaxis, (left, right), "EW", 60 * ends[2:, 1]),
    ):
        span = last - first
        step = STEPS[STEPS.searchsorted(span / 6)]
        minutes = np.arange(np.ceil((first + span / 20) / step), (last - span / 20) / step) * step
        names = [units.minutes(minute, letters) for minute in minutes]
        axis.set_ticks(np.interp(minutes, (first, last), metres), names)
    axes.tick_params(axis="y", labelrotation=90)


def _place(axes: Any, at: Floats, symbols: str, size: float, name: str, up: int, away: str) -> None:
    """Draw symbols and a name, or an arrow at the edge towards a place off the map."""
    (left, right), (bottom, top) = axes.get_xlim(), axes.get_ylim()
    middle = np.array([left + right, bottom + top]) / 2
    beside = 2 * (at - middle) / (right - left, top - bottom)
    if (beyond := abs(beside).max()) > 1:
        tip, tail = (middle + (at - middle) * share / beyond for share in (0.99, 0.89))
        axes.annotate("", tip, tail, arrowprops=BLACK | {"shrinkA": 0}, zorder=9)
        axes.plot([], [], marker=r"$\rightarrow$", label=f"{name}{away}", **SIGN)
        return
    for symbol in symbols:
        axes.plot(*at, f"k{symbol}", markerfacecolor="white", markersize=size, zorder=9)
    look: Any = {"va": "center", "bbox": BOX, "zorder": 9}
    # On the outer side where there is room, since drones fly on the other one.
    is_right = (beside[0] < 0) == (abs(beside[0]) > 0.52)
    look["ha"], offset = ("left", (11, up)) if is_right else ("right", (-11, up))
    axes.annotate(name, at, offset, textcoords="offset points", **look)


def _course(metres: Floats) -> str:
    """A distance and a direction, from an offset in metres (east, north)."""
    length, degrees = np.hypot(*metres), np.degrees(np.arctan2(*metres)) % 360
    return f"{length / 1000:.1f} km ({length / 1852:.1f} NM), {degrees:03.0f}°"


def _level(mass: Floats, share: float) -> float:
    """The probability at the edge of the smallest area that holds a share of a map."""
    ordered = np.append(np.sort(mass, axis=None)[::-1], 0.0)
    last = int((ordered.cumsum() < share * ordered.sum()).sum())
    return 0.4999 * float(ordered[last] + ordered[last + 1])  # below the likeliest cells


def _between(track: Floats, times: Any, at: Any) -> Floats:
    """The points of a track at other times, (n, 2)."""
    return np.stack([np.interp(at, times, column) for column in track.T], axis=-1)
