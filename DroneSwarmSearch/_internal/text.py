"""Words and numbers in sentences, and texts from elsewhere."""

from __future__ import annotations

from collections.abc import Sequence

LONGEST_TITLE = 100  # characters of a text from elsewhere that are shown


def plural(count: int, noun: str, ending: str = "s") -> str:
    """A number with its noun, in the plural unless it is one."""
    return f"{count} {noun}" if count == 1 else f"{count} {noun}{ending}"


def enumerated(names: Sequence[str]) -> str:
    """Names in a sentence: "1, 2 and 3"."""
    *first, last = names
    return f"{', '.join(first)} and {last}" if first else last


def capitalised(text: str) -> str:
    """A text whose first letter is large, and the others as they are."""
    return text[:1].upper() + text[1:]


def without_formulas(text: str) -> str:
    """A text in which Matplotlib reads no formula."""
    return text.replace("$", r"\$")


def printable(text: object) -> str:
    """A text from elsewhere, such as the title of a file, that every format of file can hold.

    Control characters and other ones without a shape become spaces, and the end of long texts is
    left out.
    """
    shown = "".join(sign if sign.isprintable() else " " for sign in str(text)).strip()
    if len(shown) > LONGEST_TITLE:
        shown = f"{shown[: LONGEST_TITLE - 1]}…"
    return shown
