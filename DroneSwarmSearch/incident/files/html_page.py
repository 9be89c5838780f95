"""A page to look at: the coast, drifting persons, flying drones, and the orders, in one file.

It needs no server and no other file. Its style, script and frame are in the folder `page`.
"""

from __future__ import annotations

import base64
import json
from html import escape
from importlib.resources import files
from string import Template
from typing import Any

import numpy as np

from DroneSwarmSearch._internal.arrays import Floats
from DroneSwarmSearch.geo import units
from DroneSwarmSearch.incident.files.lines import round_minutes
from DroneSwarmSearch.incident.flight_plan import FlightPlan
from DroneSwarmSearch.incident.flights import track
from DroneSwarmSearch.rendering.palette import drone_colour

PERSONS = 1200  # that are shown
STEP = 60.0  # seconds between their positions
SUCCESS_STEP = 30.0  # seconds between values of the probability of success
COLUMNS = 6  # drones in a table of orders
LARGEST = 30_000  # of the numbers that stand for positions


def html_page(plan: FlightPlan) -> str:
    """The content of plan.html."""
    folder = files("DroneSwarmSearch.incident.files") / "page"

    def text(name: str) -> str:
        return (folder / name).read_text("utf-8")

    data = _data(plan)
    incident = plan.incident
    title = (
        f"{incident.headline}: probability of success {plan.probability_of_success:.0%} by "
        f"{plan.landed:%H:%M} UTC"
    )
    land = '<li><i class="shore"></i>land</li>' if data["land"] else ""
    more = " ".join(each.sentence for each in plan.alternatives)
    return Template(text("page.html")).substitute(
        title=escape(title),
        sentence=escape(" ".join([incident.sentence, *plan.earlier, plan.success_by_part])),
        style=text("page.css"),
        script=text("page.js"),
        duration=f"{data['duration']:.0f}",
        land=land,
        known=escape(", ".join(dict.fromkeys(mark.name for mark in incident.marks))),
        briefing=escape(" ".join(plan.briefing)),
        orders=_orders(plan),
        assumptions=escape(" ".join(plan.assumptions)),
        alternatives=f"<p>{escape(more)}</p>" if more else "",
        data=json.dumps(data, separators=(",", ":")).replace("<", "\\u003c"),
    )


def _orders(plan: FlightPlan) -> str:
    """Tables with a column for each drone, and a row for each value that any of them has."""
    tables = []
    for first in range(0, len(plan.flights), COLUMNS):
        drones = range(first, min(first + COLUMNS, len(plan.flights)))
        orders = [plan.order(drone) for drone in drones]
        heads = "".join(
            f'<th scope="col"><i style="background: rgb{drone_colour(drone)}"></i>'
            f"{escape(order['drone'])}</th>"
            for drone, order in zip(drones, orders, strict=True)
        )
        rows = [f'<thead><tr><th scope="col">drone</th>{heads}</tr></thead><tbody>']
        for name in orders[0]:
            if name == "drone" or not any(order[name] for order in orders):
                continue
            cells = "".join(f"<td>{escape(order[name])}</td>" for order in orders)
            rows.append(f'<tr><th scope="row">{escape(name)}</th>{cells}</tr>')
        lines = "\n".join(rows)
        tables.append(f'<div class="wide"><table>{lines}</tbody></table></div>')
    return "\n".join(tables)


def _data(plan: FlightPlan) -> dict[str, Any]:
    """What the script draws: metres to the east and north, and seconds after the take-off."""
    incident = plan.incident
    low, high = plan.extent
    duration = (plan.landed - incident.start).total_seconds()
    land = plan.land(low, high)
    polygons = [] if land is None else land.polygons(low, high)
    return {
        "start": incident.start.timestamp(),
        "duration": duration,
        "extent": [*low.round(1).tolist(), *high.round(1).tolist()],
        "parallels": _round_lines(plan, low, high, axis=1),
        "meridians": _round_lines(plan, low, high, axis=0),
        "land": [[outline.round(0).tolist() for outline in polygon] for polygon in polygons],
        "marks": [
            mark.points.round(1).tolist() for mark in [*incident.marks, *incident.no_fly_marks]
        ],
        "flights": [_flight(plan, drone) for drone in range(len(plan.flights))],
        "persons": _persons(plan, duration),
        "success": {"step": SUCCESS_STEP, "values": _success(plan, duration)},
    }


def _flight(plan: FlightPlan, drone: int) -> dict[str, Any]:
    flight = plan.flights[drone]
    start = plan.incident.start
    craft = plan.incident.craft[drone]
    mean_of = plan.particles.mean_of
    return {
        "number": drone + 1,
        "swath": round(mean_of(craft.swath), 1),
        "detection": round(mean_of(craft.probability_of_detection), 3),
        "colour": list(drone_colour(drone)),
        "times": [round((point.time - start).total_seconds(), 1) for point in flight],
        "points": track(flight, plan.incident.plane).round(1).tolist(),
    }


def _persons(plan: FlightPlan, duration: float) -> dict[str, Any]:
    """Some persons, as likely as they are when the drones take off, and who is swept when."""
    particles = plan.particles
    rng = np.random.default_rng(0)
    n = len(particles.weights)
    chosen = rng.choice(n, size=min(PERSONS, n), p=particles.weights)
    begin = plan.incident.seconds(plan.incident.start)
    times = np.arange(0.0, duration + STEP, STEP)
    positions = np.stack([particles.at(begin + time)[chosen] for time in times])
    unit = max(1.0, float(np.abs(positions).max()) / LARGEST)
    shown: dict[int, list[int]] = {}
    for number, particle in enumerate(chosen.tolist()):
        shown.setdefault(particle, []).append(number)
    triples = [
        (number, round(time - begin), drone)
        for drone, (swept, when) in enumerate(plan.sweeps)
        for particle, time in zip(swept.tolist(), when.tolist(), strict=True)
        for number in shown.get(particle, ())
    ]
    return {
        "count": len(chosen),
        "step": STEP,
        "unit": unit,
        "positions": base64.b64encode((positions / unit).astype("<i2").tobytes()).decode(),
        "swept": [number for number, _, _ in triples],
        "when": [time for _, time, _ in triples],
        "by": [drone for _, _, drone in triples],
    }


def _success(plan: FlightPlan, duration: float) -> list[float]:
    """The probability of success by regular times, up to the last landing."""
    times = np.append(np.arange(0.0, duration, SUCCESS_STEP), duration)
    start = plan.incident.seconds(plan.incident.start)
    at = plan.incident.origin.at
    return [round(plan.success(at(start + float(time))), 4) for time in times]


def _round_lines(plan: FlightPlan, low: Floats, high: Floats, axis: int) -> list[tuple[float, str]]:
    """Round minutes of longitude, axis 0, or of latitude: metres from the origin, and names."""
    middle = (low + high) / 2
    ends = np.stack([middle, middle])
    ends[:, axis] = [low[axis], high[axis]]
    degrees = plan.incident.plane.degrees(ends)
    column = 60 * degrees[:, 1 - axis]
    column -= 21600 * np.round((column - column[0]) / 21600)  # at the date line
    first, last = column.tolist()
    letters = "EW" if axis == 0 else "NS"
    minutes = round_minutes(first, last)
    metres = np.interp(minutes, (first, last), ends[:, axis]).round(1)
    names = [units.minutes(minute, letters) for minute in minutes]
    return [*zip(metres.tolist(), names, strict=True)]
