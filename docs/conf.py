"""Sphinx configuration; `just docs` builds the site.

The site is self-contained: formulas are MathML, and fonts, scripts and the search index are local.
"""

from __future__ import annotations

import contextlib
import os
import re
import subprocess
import sys
import typing
from pathlib import Path
from typing import Any, Generic, TypeVar

import gymnasium  # noqa: F401  (must see NumPy's own types)
import numpy.typing
from docutils import nodes
from docutils.parsers.rst import Directive
from docutils.utils.math.latex2mathml import tex2mathml
from sphinx import addnodes
from sphinx.application import Sphinx
from sphinx.ext.napoleon import Config, GoogleDocstring
from sphinx.pycode import ModuleAnalyzer
from sphinx.transforms import SphinxTransform
from sphinx.util.nodes import make_refnode
from sphinx.util.typing import stringify_annotation

Item = TypeVar("Item")


class ArrayLike:
    """Replaces NumPy's union of a dozen types in signatures."""


class NDArray(Generic[Item]):
    """Replaces NumPy's generic array, which Sphinx spells out with shape and dtype."""


# The package must be imported after this, so that its annotations use the replacements.
for replacement in (ArrayLike, NDArray):
    replacement.__module__ = "numpy.typing"
    setattr(numpy.typing, replacement.__name__, replacement)

import DroneSwarmSearch  # noqa: E402

PACKAGE = Path(DroneSwarmSearch.__file__).parent
SOURCE = "\n".join(path.read_text("utf-8") for path in PACKAGE.rglob("*.py"))

project = "DroneSwarmSearch"
author = "The DroneSwarmSearch developers"
copyright = f"2026, {author}"
release = version = DroneSwarmSearch.__version__

extensions = ["myst_parser", "sphinx.ext.autodoc", "sphinx_copybutton"]
exclude_patterns = ["Thumbs.db", ".DS_Store"]

myst_enable_extensions = ["dollarmath"]
myst_heading_anchors = 4

smartquotes_action = "D"  # only dashes: quotation marks are mostly those of strings
default_role = "py:obj"  # names in docstrings become links where possible
nitpicky = True
nitpick_ignore_regex = [
    ("py:(attr|class|exc)", r".*"),  # types in signatures; Python has checked them
    ("py:obj", r".*[^\w.].*|[a-z_\d.]+|Found"),  # code, arguments and dictionary keys
]
autodoc_default_options = {"members": True}
autodoc_member_order = "bysource"
autodoc_mock_imports = [
    "benchmarl",
    "ray",
    "stable_baselines3",
    "tensordict",
    "torch",
    "torchrl",
]
autodoc_preserve_defaults = True
autodoc_typehints = "description"
autodoc_typehints_description_target = "documented_params"
autodoc_typehints_format = "short"
python_use_unqualified_type_names = True
python_maximum_signature_line_length = 88

html_theme = "furo"
html_title = f"{project} {release}"
html_logo = html_favicon = "images/logo.png"
html_static_path = ["static"]
html_css_files = ["site.css"]
html_copy_source = False
html_domain_indices = False
html_show_sourcelink = False
html_math_renderer = "mathml"
html_theme_options = {
    "light_css_variables": {"color-brand-primary": "#0b6b8a", "color-brand-content": "#0b6b8a"},
    "dark_css_variables": {"color-brand-primary": "#5cc8e6", "color-brand-content": "#5cc8e6"},
}
metadata = (PACKAGE.parent / "pyproject.toml").read_text("utf-8")
(repository,) = re.findall(r'^Repository = "(.+)"$', metadata, re.M)
if "OWNER" not in repository:  # there is a public address: every page links to its source
    html_theme_options |= {
        "source_repository": repository,
        "source_branch": "main",
        "source_directory": "docs/",
    }
highlight_language = "text"
pygments_style = "friendly"
pygments_dark_style = "monokai"
copybutton_exclude = ".linenos, .gp, .go"


def inline_mathml(self: Any, node: nodes.math) -> None:
    """Write an inline formula."""
    self.body.append(tex2mathml(node.astext(), as_block=False))
    raise nodes.SkipNode


def block_mathml(self: Any, node: nodes.math_block) -> None:
    """Write a displayed formula."""
    self.body.append(f'<div class="math">{tex2mathml(node.astext(), as_block=True)}</div>')
    raise nodes.SkipNode


class BothThemes(SphinxTransform):
    """Adds the dark version of each figure, so that the theme can choose.

    Pages only refer to `<figure>-light.svg`, which also works on GitHub.
    """

    default_priority = 200  # before images are collected

    def apply(self, **kwargs: Any) -> None:
        if self.app.builder.format != "html":
            return
        for image in list(self.document.findall(nodes.image)):
            if not image["uri"].endswith("-light.svg"):
                continue
            dark = image.copy()
            dark["uri"] = image["uri"].replace("-light.svg", "-dark.svg")
            image["classes"] = [*image["classes"], "only-light"]
            dark["classes"] = [*dark["classes"], "only-dark"]
            image.parent.insert(image.parent.index(image) + 1, dark)


class Docstring(GoogleDocstring):
    """Google style, without types: "int64, shape (n,): the steps" under "Returns:" is text."""

    def _consume_returns_section(
        self, preprocess_types: bool = False
    ) -> list[tuple[str, str, list[str]]]:
        return [("", "", self._dedent(self._consume_to_next_section()))]

    def _parse_attributes_section(self, section: str) -> list[str]:
        lines = []
        for name, _, text in self._consume_fields():
            hint = self._lookup_annotation(name)
            lines += [f".. attribute:: {name}", *([f"   :type: {hint}"] if hint else []), ""]
            lines += [*self._indent(text, 3), ""]
        return lines

    def _lookup_annotation(self, _name: str) -> str:
        hints: dict[str, Any] = {}
        with contextlib.suppress(NameError):  # in the base classes of Gymnasium's vector API
            hints = typing.get_type_hints(self._obj) if isinstance(self._obj, type) else {}
        return stringify_annotation(hints[_name], "smart") if _name in hints else ""


def read_docstring(
    app: Sphinx, what: str, name: str, thing: object, options: object, lines: list[str]
) -> None:
    """Convert a docstring to reStructuredText."""
    if what == "data":
        lines[:] = constant_docstring(name.rpartition(".")[2])
    # Napoleon would take text before a colon in an attribute's first line for its type.
    kind = "method" if what in ("attribute", "data", "property") else what
    parsed = Docstring(list(lines), Config(), app, kind, name, thing, options).lines()
    lines.clear()
    for line in parsed:
        # Headings in docstrings, as in Gymnasium; Sphinx only allows them on pages.
        heading = re.match(r"## (.+)", line)
        lines += ["", f".. rubric:: {heading[1]}", ""] if heading else [line]


def constant_docstring(name: str) -> list[str]:
    """The string below a constant, in the module that defines it."""
    for module in sorted(sys.modules):
        if module.split(".")[0] == DroneSwarmSearch.__name__:
            docstrings = ModuleAnalyzer.for_module(module).find_attr_docs()
            if ("", name) in docstrings:
                return docstrings["", name]
    return []


def find_in_package(
    app: Sphinx, env: Any, node: addnodes.pending_xref, shown: nodes.Node
) -> nodes.Node | None:
    """Resolve short names in docstrings, such as `Scenario` or `planning.success_bound`."""
    target = node.get("reftarget", "").removesuffix("()")
    if node.get("refdomain") != "py" or not re.fullmatch(r"[\w.]+", target):
        return None
    objects = env.domains["py"].objects
    full = objects.get(f"{DroneSwarmSearch.__name__}.{target}")
    matches = [entry for name, entry in objects.items() if name.endswith(f".{target}")]
    found = {(entry.docname, entry.node_id) for entry in ([full] if full else matches)}
    # A lower-case name without its module is an argument.
    if len(found) == 1 and re.search("[A-Z]|[.]" if full else "[A-Z]", target):
        document, anchor = found.pop()
        return make_refnode(app.builder, node["refdoc"], document, anchor, [shown], target)
    # Names that exist but are not documented are not links; others are reported as broken.
    last = target.rpartition(".")[2]
    return shown if re.search(rf"^ *(class|def) {last}\b|^ *{last}\b.* = ", SOURCE, re.M) else None


class CommandHelp(Directive):
    """The output of `python -m DroneSwarmSearch COMMAND --help`."""

    optional_arguments = 1

    def run(self) -> list[nodes.Node]:
        output = subprocess.run(
            [sys.executable, "-m", DroneSwarmSearch.__name__, *self.arguments, "--help"],
            cwd=PACKAGE.parent,
            env={**os.environ, "COLUMNS": "88", "NO_COLOR": "1", "PYTHONUTF8": "1"},
            stdout=subprocess.PIPE,
            encoding="utf-8",
            check=True,
        ).stdout
        return [nodes.literal_block(output, output, language="text")]


class LeewayClasses(Directive):
    """A table of the object classes, with their leeway in a wind of 10 m/s."""

    def run(self) -> list[nodes.Node]:
        lines = [".. csv-table::", "   :header: Key, Object, Downwind, Crosswind", ""]
        for kind in DroneSwarmSearch.persons.leeway.CLASSES.values():
            at_10 = kind.speeds(10)
            cells = (
                f"``{kind.name}``",
                kind.description,
                f"{at_10.downwind:.2f} ± {at_10.downwind_sd:.2f}",
                f"{at_10.right:+.2f} or {at_10.left:+.2f} ± {at_10.right_sd:.2f}",
            )
            lines.append("   " + ", ".join(f'"{cell}"' for cell in cells))
        self.state_machine.insert_input(lines, "leeway-classes")
        return []


def add_player(app: Sphinx, page: str, template: str, context: Any, document: Any) -> None:
    """Load the player of episodes on its page only."""
    if page == "play":
        app.add_css_file("play.css")
        app.add_js_file("episodes/index.js", loading_method="defer")
        app.add_js_file("play.js", loading_method="defer")


def setup(app: Sphinx) -> None:
    """Register the extensions above."""
    app.add_html_math_renderer("mathml", (inline_mathml, None), (block_mathml, None))
    app.add_transform(BothThemes)
    app.add_directive("command-help", CommandHelp)
    app.add_directive("leeway-classes", LeewayClasses)
    app.connect("autodoc-process-docstring", read_docstring)
    app.connect("missing-reference", find_in_package)
    app.connect("html-page-context", add_player)
