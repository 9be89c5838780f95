"""The map of a flight plan, on a page of A4 that is legible in black and white."""

from __future__ import annotations

import io
from collections.abc import Sequence
from dataclasses import dataclass
from datetime import datetime
from functools import cached_property
from pathlib import Path
from textwrap import fill
from typing import TYPE_CHECKING, Any

import numpy as np

from DroneSwarmSearch._internal.arrays import Floats
from DroneSwarmSearch._internal.extras import import_matplotlib
from DroneSwarmSearch._internal.files import write_bytes
from DroneSwarmSearch._internal.text import without_formulas
from DroneSwarmSearch.geo import units
from DroneSwarmSearch.geo.units import KNOT
from DroneSwarmSearch.incident.files.lines import STEPS, round_minutes
from DroneSwarmSearch.incident.flight_plan import FlightPlan
from DroneSwarmSearch.incident.flights import track, up_to_the_minute
from DroneSwarmSearch.rendering.palette import INK, drone_colour, readable_on, style_sheet

if TYPE_CHECKING:
    from matplotlib.figure import Figure

# In points.
PAGE = np.array([595.0, 842.0])
SHEET = np.array([515.0, 390.0])  # the map
LEFT = 50
MAP_BOTTOM = 355
TABLE_TOP = 263
ROW_HEIGHT = 8.1
NAMES_WIDTH = 85
FEWEST_COLUMNS = 3
TEXT_BOTTOM = 16
LINE_HEIGHT = 9.7
FONT_SIZES = (7.5, 7.0, 6.5, 6.0, 5.5)  # of the assumptions, the first one that fits
CHARACTERS = 1012  # of a size of 1 in a line

PER_SHEET = 6
"""The most drones whose flights are told apart on a sheet; more are drawn on further sheets."""

WIDER = 1.6  # a position is only on the map if it does not become so many times as wide

DASHES = ((9, 0), (5, 1.6), (1.2, 1), (7, 1.4, 1.2, 1.4), (2.6, 1.2), (7, 1.4, 1.2, 1.4, 1.2, 1.4))
HEAD: Any = {"arrowstyle": "-|>,head_length=.5,head_width=.25", "linewidth": 0, "shrinkB": 0}
BLACK: Any = {"arrowstyle": "simple", "color": "black", "shrinkB": 0}
BOX: Any = {"facecolor": "white", "edgecolor": "none", "boxstyle": "round,pad=.1"}
SIGN: Any = {"color": "black", "linestyle": "", "markersize": 10}
CENTRED: Any = {"ha": "center", "va": "center_baseline", "fontsize": 7.5}
LAND = "#f3ecdc"
STYLE = {
    "hatch.linewidth": 0.4,
    "axes.grid": True,
    "font.size": 8,
    "legend.frameon": False,
    "lines.markeredgecolor": "auto",
    "svg.hashsalt": "DroneSwarmSearch",  # equal maps make equal files
}


def write(plan: FlightPlan, folder: Path) -> None:
    """Write `map.png`, 1,322 pixels wide, and `map.svg`, and perhaps more sheets, `map2.png`..."""
    import_matplotlib("the map needs the package matplotlib", "plan")
    from matplotlib import style

    with style.context(["default", style_sheet("light"), STYLE]):
        for sheet, first in enumerate(range(0, len(plan.flights), PER_SHEET), 1):
            drones = range(first, min(first + PER_SHEET, len(plan.flights)))
            figure = draw(plan, drones)
            stem = "map" if sheet == 1 else f"map{sheet}"
            for kind, metadata in (("png", {}), ("svg", {"Date": None, "Creator": None})):
                content = io.BytesIO()
                figure.savefig(content, format=kind, dpi=160, metadata=metadata)
                write_bytes(folder / f"{stem}.{kind}", content.getvalue())


def draw(plan: FlightPlan, drones: Sequence[int]) -> Figure:
    """Draw the flights of some drones over the areas where the person may be; north is up.

    Lines enclose the smallest areas that hold 50% and 90% of the probability if nobody searches,
    dashed when the search begins and solid at the last landing. The grey is the map at the start.
    Each drone's strips have its colour.
    """
    from matplotlib.figure import Figure

    width, height = PAGE / 72  # in inches
    figure = Figure((width, height))
    axes: Any = figure.add_axes((LEFT / PAGE[0], MAP_BOTTOM / PAGE[1], *SHEET / PAGE))
    flights = [_DrawnFlight(plan, drone) for drone in drones]
    sheet = _Sheet(axes, plan, flights)
    sheet.draw_areas()
    sheet.set_limits()
    sheet.draw_land()
    sheet.draw_graticule()
    sheet.draw_current()
    sheet.draw_drift()
    sheet.draw_no_fly()
    sheet.draw_positions()
    sheet.draw_flights()
    sheet.draw_legend()
    sheet.draw_title()
    room = _draw_table(figure, plan, drones) - TEXT_BOTTOM
    words = " ".join([*plan.briefing, *plan.assumptions])
    for size in FONT_SIZES:
        text = _wrapped(words, round(CHARACTERS / size))
        if (text.count("\n") + 1) * LINE_HEIGHT * size / FONT_SIZES[0] <= room:
            break
    figure.text(LEFT / PAGE[0], TEXT_BOTTOM / PAGE[1], text, va="bottom", fontsize=size)
    return figure


@dataclass(frozen=True)
class _DrawnFlight:
    """A flight on the map."""

    plan: FlightPlan
    drone: int

    @cached_property
    def points(self) -> Floats:
        """The waypoints, (east, north) in metres: (n, 2)."""
        return track(self.plan.flights[self.drone], self.plan.incident.plane)

    @cached_property
    def minutes(self) -> list[float]:
        """Their times, in minutes after the first take-off."""
        start = self.plan.incident.start
        flight = self.plan.flights[self.drone]
        return [(point.time - start).total_seconds() / 60 for point in flight]

    @property
    def pattern(self) -> Floats:
        """The points from the commence search point to where the drone leaves."""
        return self.points[self.plan.searches[self.drone]]

    @property
    def searching(self) -> list[float]:
        """The minutes at these points."""
        return self.minutes[self.plan.searches[self.drone]]

    def at(self, minutes: Any) -> Floats:
        """The positions at other times, (n, 2)."""
        return np.stack(
            [np.interp(minutes, self.minutes, column) for column in self.points.T], axis=-1
        )


class _Sheet:
    """The map: what it shows, and its limits once they are set; drawn step by step.

    Attributes:
        point: the metres of a point of the page.
        low, high: the corners in metres, (east, north).
        marked: places near which nothing else is written.
    """

    def __init__(self, axes: Any, plan: FlightPlan, flights: list[_DrawnFlight]) -> None:
        self._axes = axes
        self._plan = plan
        self._incident = plan.incident
        self._flights = flights
        self._means: list[Floats] = []  # of the positions, at the start and at the end
        self._corners: list[Floats] = []  # of what must be on the map
        self.points = [mark for mark in self._incident.marks if len(mark.points) == 1]
        first = self._plan.flights[0][0]
        self.base = self._incident.plane.metres(first.latitude, first.longitude)
        self.marked = [self.base, *(mark.points[0] for mark in self.points)]

    # What is on the map.

    def draw_areas(self) -> None:
        """Draw the first map in grey, and the areas at the start and at the end."""
        start = self._plan.on_scene
        end = self._plan.landed
        self._draw_area(start, up_to_the_minute(start), "--")
        self._draw_area(end, end, "-")
        self._axes.set_aspect("auto")

    def _draw_area(self, time: datetime, shown: datetime, dashes: str) -> None:
        """The smallest areas that hold 50% and 90% of the probability at a time."""
        axes = self._axes
        is_first = not self._means
        mass, (west, south), (east, north) = self._plan.density(time)
        if is_first:
            axes.imshow(
                mass,
                "Greys",
                extent=(west, east, south, north),
                vmax=3 * mass.max(),
                interpolation="bilinear",
                zorder=0,
            )
        side = (east - west) / len(mass)
        x = west + side * (np.arange(len(mass)) + 0.5)
        y = north - side * (np.arange(len(mass)) + 0.5)
        for share in (50, 90):
            lines = axes.contour(
                x,
                y,
                mass,
                [_level(mass, share / 100)],
                colors="0.2",
                linestyles=dashes,
                linewidths=0.9,
                zorder=3,
            )
            line = np.vstack(lines.allsegs[0])
            # In the north at the start and in the south at the end, so that labels lie apart.
            at = line[line[:, 1].argmax() if is_first else line[:, 1].argmin()]
            axes.clabel(lines, fmt=f"{share}%%", fontsize=7.5, manual=[at])
        self._corners += [line.min(axis=0), line.max(axis=0)]  # of the larger area
        label = f"50% and 90% areas at {shown:%H:%M}"
        axes.plot([], [], dashes, color="0.2", linewidth=0.9, label=label)
        self._means.append(self._plan.particles.mean(self._incident.seconds(time)))

    def set_limits(self) -> None:
        """Choose the limits of the map: the areas, the patterns, and positions that are near."""
        corners = [*self._corners]
        for flight in self._flights:
            corners += [flight.pattern.min(axis=0), flight.pattern.max(axis=0)]
        for position in self.marked:
            low = np.min(corners, axis=0)
            high = np.max(corners, axis=0)
            if np.all(np.abs(position - (low + high) / 2) < WIDER / 2 * (high - low).max()):
                corners.append(position)
        low = np.min(corners, axis=0)
        high = np.max(corners, axis=0)
        self.point = 1.12 * ((high - low) / SHEET).max()
        self.low = (low + high - self.point * SHEET) / 2
        self.high = (low + high + self.point * SHEET) / 2
        left, bottom = self.low
        right, top = self.high
        self._axes.set(xlim=(left, right), ylim=(bottom, top))

    # The steps of drawing.

    def draw_land(self) -> None:
        """Draw land, hatched, and its shores."""
        from matplotlib.patches import PathPatch
        from matplotlib.path import Path as Outline

        land = self._plan.land(self.low, self.high)
        if land is None:
            return
        polygons = land.polygons(self.low, self.high)
        for polygon in polygons:
            outlines = [Outline(outline, closed=True) for outline in polygon]
            shape = Outline.make_compound_path(*outlines)
            hatched = PathPatch(
                shape, facecolor=LAND, edgecolor="0.7", hatch="////", linewidth=0, zorder=1
            )
            self._axes.add_patch(hatched)
            shore = PathPatch(shape, facecolor="none", edgecolor="0.25", linewidth=0.8, zorder=1)
            self._axes.add_patch(shore)
        if polygons:
            hatched.set_label("land")

    def draw_graticule(self) -> None:
        """Put ticks and lines at round minutes of latitude and longitude."""
        left, bottom = self.low
        right, top = self.high
        x = (left + right) / 2
        y = (bottom + top) / 2
        ends = self._incident.plane.degrees([(x, bottom), (x, top), (left, y), (right, y)])
        ends[:, 1] -= 360 * np.round((ends[:, 1] - ends[0, 1]) / 360)  # at the date line
        _set_ticks(self._axes.yaxis, (bottom, top), 60 * ends[:2, 0], "NS")
        _set_ticks(self._axes.xaxis, (left, right), 60 * ends[2:, 1], "EW")
        self._axes.tick_params(axis="y", labelrotation=90)

    def draw_current(self) -> None:
        """Draw arrows for a current that differs between places."""
        current = self._incident.current
        if not current.varies:
            return
        across, along = (
            np.linspace(low, high, 14)[1:-1] for low, high in zip(self.low, self.high, strict=True)
        )
        grid = np.stack(np.meshgrid(across, along)).reshape(2, -1)
        time = self._plan.on_scene
        arrows = current.velocity(self._incident.seconds(time), grid)
        fastest = f"{np.nanmax(np.hypot(*arrows)) / KNOT:.1f} kn"
        label = f"current at {up_to_the_minute(time):%H:%M}, up to {fastest}"
        look = {**SIGN, "color": "0.45"}
        self._axes.plot([], [], marker=r"$\rightarrow$", label=label, **look)
        self._axes.quiver(*grid, *arrows, color="0.45", width=0.0016, pivot="middle", zorder=1)

    def draw_drift(self) -> None:
        """Draw an arrow along the mean drift."""
        start, end = self._means
        arrow = {
            "arrowstyle": "simple,head_width=.8,tail_width=.3",
            "facecolor": "white",
            "shrinkA": 0,
            "shrinkB": 0,
        }
        self._axes.annotate("", end, start, arrowprops=arrow, zorder=6)
        label = f"mean drift {_course(end - start)}"
        self._axes.plot([], [], marker=r"$\Rightarrow$", label=label, **SIGN)
        first = up_to_the_minute(self._incident.start)
        label = f"minutes since {first:%H:%M}"
        self._axes.plot([], [], marker="$10$", label=label, **SIGN)

    def draw_positions(self) -> None:
        """Draw where drones take off, and what is known of where persons were."""
        known = self.points[0].points[0] if self.points else np.zeros(2)
        up = 11 if known[1] >= self.base[1] else -11  # the northern name above its position
        way = self.base - known
        away = ""
        if np.hypot(*way) > self.point:
            away = f": {_course(way)} from there"
        take_off = f"take-off, {up_to_the_minute(self._incident.start):%H:%M}"
        self._draw_position(self.base, symbols="s", size=15, name=take_off, up=-up, away=away)
        for name, when, points in self._incident.marks:
            label = f"{name}, {when}"
            if len(points) == 1:
                self._draw_position(points[0], symbols="oP", size=8, name=label, up=up, away="")
            else:
                self._axes.plot(*points.T, "k:", linewidth=1.4, label=label, zorder=8)

    def draw_no_fly(self) -> None:
        """Draw the areas that nobody enters, hatched."""
        label = "no-fly area"
        for mark in self._incident.no_fly_marks:
            self._axes.fill(
                *mark.points.T,
                facecolor="none",
                edgecolor="0.2",
                hatch="xx",
                linewidth=1.0,
                label=label,
                zorder=7,
            )
            label = "_"

    def _draw_position(
        self, at: Floats, *, symbols: str, size: float, name: str, up: int, away: str
    ) -> None:
        """Draw symbols and a name, or an arrow at the edge towards a position off the map."""
        axes = self._axes
        middle = (self.low + self.high) / 2
        beside = 2 * (at - middle) / (self.high - self.low)
        beyond = abs(beside).max()
        if beyond > 1:
            tip = middle + (at - middle) * 0.99 / beyond
            tail = middle + (at - middle) * 0.89 / beyond
            axes.annotate("", tip, tail, arrowprops={**BLACK, "shrinkA": 0}, zorder=9)
            axes.plot([], [], marker=r"$\rightarrow$", label=f"{name}{away}", **SIGN)
            return
        for symbol in symbols:
            axes.plot(*at, f"k{symbol}", markerfacecolor="white", markersize=size, zorder=9)
        # On the outer side where there is room, since drones fly on the other one.
        is_right = (beside[0] < 0) == (abs(beside[0]) > 0.52)
        axes.annotate(
            name,
            at,
            (11 if is_right else -11, up),
            textcoords="offset points",
            ha="left" if is_right else "right",
            va="center",
            bbox=BOX,
            zorder=9,
        )

    def draw_flights(self) -> None:
        """Draw all flights, with the minutes along them where there is room."""
        flown = sum(flight.minutes[-1] - flight.minutes[0] for flight in self._flights)
        step = STEPS[STEPS.searchsorted(flown / 30)]
        for flight in self._flights:
            self._draw_track(flight)
            self._draw_minutes(flight, step)

    def _swath(self, flight: _DrawnFlight) -> float:
        """The width of the strip that a drone sees, in metres; the mean of all object classes."""
        return self._plan.particles.mean_of(self._incident.craft[flight.drone].swath)

    def _draw_track(self, flight: _DrawnFlight) -> None:
        """The strip that a drone sees, its track with arrows, and its number."""
        from matplotlib.patheffects import Normal, Stroke

        axes = self._axes
        disc = drone_colour(flight.drone)
        colour = np.array(disc) / 255
        ink = np.array(INK) / 255
        number_colour = np.array(readable_on(disc)) / 255
        axes.plot(
            *flight.pattern.T,
            color=colour,
            alpha=0.3,
            linewidth=self._swath(flight) / self.point,
            solid_capstyle="butt",
            zorder=2,
        )
        search = self._plan.searches[flight.drone]
        for way in (flight.points[: search.start + 1], flight.points[search.stop - 1 :]):
            axes.plot(*way.T, ":", color=ink, linewidth=0.7)
        axes.plot(
            *flight.pattern.T,
            linestyle=(0, DASHES[flight.drone % len(DASHES)]),
            label=self._incident.craft[flight.drone].label,
            color=colour,
            linewidth=1.2,
            path_effects=[Stroke(linewidth=2.4, foreground=ink), Normal()],
        )
        speed = self._incident.craft[flight.drone].speed
        apart = self.point / speed  # minutes between heads of arrows, 60 points apart
        for minute in np.arange(flight.searching[0] + apart / 2, flight.searching[-1], apart):
            tail, tip = flight.at([minute - apart / 20, minute + apart / 20])
            axes.annotate("", tip, tail, arrowprops={**HEAD, "color": ink})
        circle = {"boxstyle": "circle", "facecolor": colour, "edgecolor": ink}
        start = flight.pattern[0]
        axes.text(
            *start,
            f"{flight.drone + 1}",
            bbox=circle,
            color=number_colour,
            clip_on=True,
            zorder=10,
            **CENTRED,
        )
        self.marked.append(start)

    def _draw_minutes(self, flight: _DrawnFlight, step: float) -> None:
        """Write round minutes beside a track."""
        first = np.ceil(flight.searching[0] / step)
        minutes = np.arange(first, flight.searching[-1] / step) * step
        for minute, at in zip(minutes, flight.at(minutes), strict=True):
            if np.abs(at - self.marked).max(axis=1).min() > 13 * self.point:
                self._axes.text(*at, f"{minute:g}", bbox=BOX, zorder=8, clip_on=True, **CENTRED)
                self.marked.append(at)

    def draw_legend(self) -> None:
        """Draw what signs mean, two scales, and north."""
        axes = self._axes
        axes.legend(
            loc="upper left", bbox_to_anchor=(0, -0.105), ncols=3, handlelength=4, borderpad=0
        )
        look: Any = {"transform": axes.get_xaxis_transform(), "clip_on": False}
        for y, metres, unit in ((-0.062, 1000, "km"), (-0.09, 1852, "NM")):
            length = STEPS[STEPS.searchsorted(150 * self.point / metres) - 1]
            x = self.low[0] + np.linspace(0, length * metres, 3)
            axes.plot(x, [y, y, y], "k|-", **look)
            axes.text(x[2] + 5 * self.point, y, f"{length:g} {unit}", va="center", **look)
        axes.annotate(
            "N",
            (0.98, -0.03),
            (0.98, -0.11),
            arrowprops=BLACK,
            xycoords="axes fraction",
            annotation_clip=False,
            ha="center",
        )

    def draw_title(self) -> None:
        """Write the probability of success, and the incident."""
        success = f"{self._plan.probability_of_success:.0%} by {self._plan.landed:%H:%M} UTC"
        title = _wrapped(f"{self._incident.headline}: probability of success {success}", 78)
        sentences = f"{self._incident.sentence} {self._plan.success_by_part}"
        text = _wrapped(sentences, 130)
        pad = 14.5 + LINE_HEIGHT * (text.count("\n") + 1)
        axes = self._axes
        axes.set_title(title, loc="left", pad=pad, fontsize=12, weight="bold")
        above = 1 + 5 / SHEET[1]
        axes.text(0, above, text, transform=axes.transAxes, va="bottom", fontsize=7.5)


def _set_ticks(axis: Any, metres: tuple[float, float], ends: Floats, letters: str) -> None:
    """Put ticks at round minutes; the axis goes from one end, in minutes, to the other."""
    minutes = round_minutes(*ends)
    names = [units.minutes(minute, letters) for minute in minutes]
    axis.set_ticks(np.interp(minutes, ends, metres), names)


def _draw_table(figure: Figure, plan: FlightPlan, drones: Sequence[int]) -> float:
    """The orders: a column for each drone, a row for each value that any of them has.

    Returns where the table ends, in points.
    """
    orders = [plan.order(drone) for drone in drones]
    names = [name for name in orders[0] if any(order[name] for order in orders)]
    axes = figure.add_axes((0, 0, 1, 1), xlim=(0, PAGE[0]), ylim=(0, PAGE[1]), facecolor="none")
    axes.axis("off")
    width = (SHEET[0] - NAMES_WIDTH) / max(len(orders), FEWEST_COLUMNS)
    for row, name in enumerate(names):
        y = TABLE_TOP - (row + 0.5) * ROW_HEIGHT
        look: Any = {"va": "center_baseline", "fontsize": 6.5 if len(orders) < PER_SHEET else 5.7}
        if row == 0:
            look["weight"] = "bold"
        if row % 2:
            band = [y - ROW_HEIGHT / 2, y + ROW_HEIGHT / 2]
            axes.fill_betweenx(band, LEFT - 3, LEFT + SHEET[0], color="0.94", linewidth=0)
        axes.text(LEFT, y, name, **look)
        for column, order in enumerate(orders):
            x = LEFT + NAMES_WIDTH + column * width
            axes.text(x, y, order[name], **look)
    return TABLE_TOP - len(names) * ROW_HEIGHT


def _wrapped(text: str, width: int) -> str:
    """A text in lines of at most so many characters, in which Matplotlib reads no formula."""
    return without_formulas(fill(text, width))


def _course(metres: Floats) -> str:
    """A distance and a direction, from an offset in metres (east, north)."""
    length = np.hypot(*metres)
    degrees = np.degrees(np.arctan2(*metres)) % 360
    return f"{length / 1000:.1f} km ({length / 1852:.1f} NM), {degrees:03.0f}°"


def _level(mass: Floats, share: float) -> float:
    """The probability at the edge of the smallest area that holds a share of a map."""
    ordered = np.append(np.sort(mass, axis=None)[::-1], 0.0)
    last = int((ordered.cumsum() < share * ordered.sum()).sum())
    return 0.4999 * float(ordered[last] + ordered[last + 1])  # below the likeliest cells
