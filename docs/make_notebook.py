"""Make the notebook of the tutorial, `docs/tutorial.ipynb`, from `docs/tutorial.md`.

    python docs/make_notebook.py

The notebook leaves out what is between the comments `<!-- page only -->` and `<!-- end of page
only -->`, and includes what is inside the comments `<!-- notebook only ... -->`. It begins with a
cell that installs the package where it is missing, as in Colab.
"""

from __future__ import annotations

import json
import re
from pathlib import Path

DOCS = Path(__file__).parent
PAGE = DOCS / "tutorial.md"
NOTEBOOK = DOCS / "tutorial.ipynb"

PLACEHOLDER = "OWNER"
"""In the repository's address, until there is a public one."""

COLAB = "https://colab.research.google.com"


def project(key: str) -> str:
    """The value of a key of `pyproject.toml`."""
    text = (DOCS.parent / "pyproject.toml").read_text("utf-8")
    (value,) = re.findall(rf'^{key} = "(.+)"$', text, re.M)
    return str(value)


def cells(page: str, address: str) -> list[dict[str, object]]:
    """The cells of the notebook.

    Args:
        page: the tutorial in Markdown.
        address: of the repository. With a public address, the first cell has a link that opens
            the notebook in Colab, and links lead to the repository's pages.
    """
    package = f"{project('name')}[evaluation,video]"
    page = re.sub(r"<!-- page only -->.*?<!-- end of page only -->\n", "", page, flags=re.S)
    page = re.sub(r"<!-- notebook only\n(.*?)-->\n", r"\1", page, flags=re.S)
    page = re.sub(r"^```text\n.*?^```\n", "", page, flags=re.M | re.S)
    install = f"""\
try:
    import DroneSwarmSearch
except ImportError:
    %pip install -q "{package} @ git+{address}"
"""
    if PLACEHOLDER not in address:
        page = re.sub(r"\]\((?!https:|#)", f"]({address}/blob/main/docs/", page)
        path = address.replace("https://github.com", "github")
        notebook = f"{COLAB}/{path}/blob/main/docs/{NOTEBOOK.name}"
        badge = f"[![Open in Colab]({COLAB}/assets/colab-badge.svg)]({notebook})"
        page = page.replace("\n\n", f"\n\n{badge}\n\n", 1)
    before, *rest = re.split(r"^(## .*)$", page, maxsplit=1, flags=re.M)
    page = f"{before}```python\n{install}```\n{''.join(rest)}"
    made = []
    for number, text in enumerate(re.split(r"^```python\n(.*?)^```\n", page, flags=re.M | re.S)):
        if text.strip():
            made.append(cell(len(made), text.strip(), is_code=number % 2 == 1))
    return made


def cell(number: int, text: str, *, is_code: bool) -> dict[str, object]:
    """A cell without output, in Jupyter's format."""
    shared = {"id": f"cell-{number}", "metadata": {}, "source": text.splitlines(keepends=True)}
    if is_code:
        return {"cell_type": "code", "execution_count": None, "outputs": [], **shared}
    return {"cell_type": "markdown", **shared}


def notebook() -> str:
    """The content of the notebook's file."""
    content = {
        "cells": cells(PAGE.read_text("utf-8"), project("Repository")),
        "metadata": {
            "kernelspec": {"display_name": "Python 3", "language": "python", "name": "python3"},
            "language_info": {"name": "python"},
        },
        "nbformat": 4,
        "nbformat_minor": 5,
    }
    return json.dumps(content, indent=1, ensure_ascii=False) + "\n"


if __name__ == "__main__":
    NOTEBOOK.write_text(notebook(), encoding="utf-8", newline="\n")
