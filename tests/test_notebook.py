"""The tutorial as a notebook, and what notebooks show of environments and videos."""

import ast
import contextlib
import io
import json
from pathlib import Path
from typing import Any

import pytest
from documents import blocks
from helpers import few_pictures, module_at

from DroneSwarmSearch import DroneSwarmSearch

pytestmark = pytest.mark.thorough

ROOT = Path(__file__).parents[1]

make_notebook = module_at(ROOT / "docs" / "make_notebook.py")


@pytest.fixture(scope="module")
def notebook():
    content: dict[str, Any] = json.loads(make_notebook.NOTEBOOK.read_text("utf-8"))
    return content


def run_cell(source: str, names: dict[str, Any]) -> object:
    """Run a cell's code and return the value of its last expression, as Jupyter does."""
    code = ast.parse(source.replace("%pip", "pass  # "))
    last = code.body.pop() if isinstance(code.body[-1], ast.Expr) else None
    exec(compile(code, "cell", "exec"), names)
    if last is None:
        return None
    return eval(compile(ast.Expression(last.value), "cell", "eval"), names)


def test_the_notebook_is_up_to_date():
    text = make_notebook.NOTEBOOK.read_text("utf-8")
    assert text == make_notebook.notebook(), "python docs/make_notebook.py"


def test_the_cells_run_in_order(notebook, tmp_path, monkeypatch):
    """They print what the tutorial shows."""
    pytest.importorskip("matplotlib")
    pytest.importorskip("PIL")
    few_pictures(monkeypatch)
    monkeypatch.chdir(tmp_path)
    monkeypatch.setenv("MPLBACKEND", "Agg")
    names: dict[str, Any] = {"__name__": "__main__"}
    outputs = {
        block.text.strip(): block.output
        for block in blocks("python")
        if block.name.startswith("docs/tutorial.md")
    }
    shown = []
    ran = set()
    for cell in notebook["cells"]:
        if cell["cell_type"] == "code":
            source = "".join(cell["source"])
            with contextlib.redirect_stdout(io.StringIO()) as printed:
                shown.append(run_cell(source, names))
            ran.add(source)
            if outputs.get(source) is not None:
                assert printed.getvalue().rstrip() == outputs[source].rstrip()
    assert outputs.keys() <= ran
    env, video = (value for value in shown if value is not None)
    assert isinstance(env, DroneSwarmSearch)
    assert video.path.read_bytes().startswith(b"GIF89a")


def test_a_public_address_adds_links():
    page = make_notebook.PAGE.read_text("utf-8")
    first, install, *_ = make_notebook.cells(page, "https://github.com/me/it")
    assert (
        "https://colab.research.google.com/github/me/it/blob/main/docs/tutorial.ipynb"
        in "".join(first["source"])
    )
    assert "git+https://github.com/me/it" in "".join(install["source"])
    text = json.dumps(make_notebook.cells(page, "https://github.com/me/it"))
    assert "](https://github.com/me/it/blob/main/docs/model.md)" in text
    assert "](model.md)" not in text


def test_an_environment_is_shown_as_a_picture():
    image = pytest.importorskip("PIL.Image")
    env = DroneSwarmSearch.example()
    assert env._repr_png_() is None
    env.reset(seed=0)
    data = env._repr_png_()
    assert data is not None
    picture = image.open(io.BytesIO(data))
    assert picture.format == "PNG"
    other = DroneSwarmSearch.example(render_mode="rgb_array")
    other.reset(seed=0)
    assert (other.render() == picture.convert("RGB")).all()
