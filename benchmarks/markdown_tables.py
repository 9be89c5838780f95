"""Tables in Markdown, and pages in which they stand between two marks."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

END = "<!-- /table -->\n"


def markdown(rows: Sequence[Sequence[str]]) -> str:
    """A table; the first row is its head, and all columns but the first are numbers."""
    head, *others = rows
    marks = ["---", *["---:"] * (len(head) - 1)]
    return "".join(f"| {' | '.join(cells)} |\n" for cells in (head, marks, *others))


def with_table(page: Path, command: str, table: str) -> str:
    """The text of a page with a table in place of the one that this command has written."""
    begin = f"<!-- table: {command} -->\n"
    before, mark, rest = page.read_text("utf-8").partition(begin)
    if not mark:
        raise ValueError(f"{page.name} must have the line {begin!r}")
    return before + begin + table + END + rest.partition(END)[2]
