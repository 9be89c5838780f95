"""A page with the log of all sorties: what is flown and planned, and what each flight adds."""

from __future__ import annotations

from html import escape
from importlib.resources import files

from DroneSwarmSearch.incident.by_class import in_words
from DroneSwarmSearch.incident.flight_plan import FlightPlan, LogEntry
from DroneSwarmSearch.incident.flights import down_to_the_minute, up_to_the_minute

HEADS = ("drone", "", "take-off", "landing", "strip", "POD in it", "worth", "cumulative")


def log_page(plan: FlightPlan) -> str:
    """The content of log.html."""
    css = files("DroneSwarmSearch.incident.files").joinpath("page", "page.css").read_text("utf-8")
    heads = "".join(f'<th scope="col">{escape(head)}</th>' for head in HEADS)
    rows = []
    total = 0.0
    for entry in plan.log:
        total += entry.worth
        cells = "".join(f"<td>{escape(text)}</td>" for text in _cells(entry, total))
        rows.append(f"<tr>{cells}</tr>")
    title = f"Sorties: {plan.incident.headline}"
    table = "\n".join(rows)
    return f"""<!doctype html>
<html lang="en">
<head>
<meta charset="utf-8">
<meta name="viewport" content="width=device-width, initial-scale=1">
<meta name="color-scheme" content="light dark">
<link rel="icon" href="data:,">
<title>{escape(title)}</title>
<style>
{css}
</style>
</head>
<body>
<header>
<h1>{escape(title)}</h1>
<p>{escape(" ".join([plan.incident.sentence, *plan.earlier]))}</p>
</header>
<main>
<section class="orders" style="grid-column: 1 / -1" aria-label="Sorties">
<div class="wide"><table>
<thead><tr>{heads}</tr></thead>
<tbody>
{table}
</tbody></table></div>
<p class="small">Times are in UTC. Worth is the share of all persons that a flight finds, and no
flight before it; in the order of the table.</p>
</section>
</main>
</body>
</html>
"""


def _cells(entry: LogEntry, total: float) -> tuple[str, ...]:
    """The texts of a row, in the order of `HEADS`."""
    return (
        entry.drone,
        "planned" if entry.is_planned else "flown",
        f"{up_to_the_minute(entry.take_off):%Y-%m-%d %H:%M}",
        f"{down_to_the_minute(entry.landing):%H:%M}",
        in_words(entry.swath, "{:.0f} m".format),
        in_words(entry.probability_of_detection, "{:.0%}".format),
        f"{entry.worth:.1%}",
        f"{total:.1%}",
    )
