"""How Sphinx builds the documentation: `just docs`, or what stands in the justfile for it.

Nothing is fetched, neither by the build nor by the pages: formulas are MathML, and fonts,
scripts and the search index come with the site.
"""

from __future__ import annotations

import contextlib
import importlib
import io
import os
import pkgutil
import re
import sys
import types
import typing
from typing import Any, Generic, TypeVar

import gymnasium  # noqa: F401  (before NumPy's names are replaced)
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
    """Stands for NumPy's union of a dozen types, which nobody wants to read."""


class NDArray(Generic[Item]):
    """Stands for NumPy's generic array, which would be spelt out with shape and dtype."""


# Before the package is imported, whose annotations these names are in.
for stand_in in (ArrayLike, NDArray):
    stand_in.__module__ = "numpy.typing"
    setattr(numpy.typing, stand_in.__name__, stand_in)

import DroneSwarmSearch  # noqa: E402
import DroneSwarmSearch.__main__  # noqa: E402

project = "DroneSwarmSearch"
author = "The DroneSwarmSearch developers"
copyright = f"2026, {author}"
release = version = DroneSwarmSearch.__version__

extensions = [
    "myst_parser",
    "sphinx.ext.autodoc",
    "sphinx.ext.autosummary",
    "sphinx_copybutton",
]
exclude_patterns = ["Thumbs.db", ".DS_Store"]

myst_enable_extensions = ["dollarmath"]
myst_heading_anchors = 4

smartquotes_action = "D"  # dashes alone: quotation marks are mostly those of strings
default_role = "py:obj"  # in docstrings: a link where there is something to link to
nitpicky = True  # what looks like a name of ours must be one
nitpick_ignore_regex = [
    ("py:.*", r"(abc|argparse|collections|contextlib|copy|enum|os|pathlib|typing)\..*"),
    ("py:.*", r"(gymnasium|numpy|np|pettingzoo|stable_baselines3)\..*"),
    ("py:.*", r"DroneSwarmSearch\.(mappings\.Value|probability_matrix\.Number)"),  # type variables
    ("py:obj", r".*[^\w.].*|[a-z_\d.]+|Found"),  # code, and names of arguments and entries
]
autodoc_default_options = {"members": True, "show-inheritance": True}
autodoc_member_order = "bysource"
autodoc_mock_imports = ["stable_baselines3"]
autodoc_preserve_defaults = True
autodoc_typehints = "description"
autodoc_typehints_description_target = "documented_params"
autodoc_typehints_format = "short"
autosummary_generate = False
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
highlight_language = "text"  # of blocks that name none, such as formulas
pygments_style = "friendly"
pygments_dark_style = "monokai"
copybutton_exclude = ".linenos, .gp, .go"


def inline_mathml(self: Any, node: nodes.math) -> None:
    """Write a formula in a line."""
    self.body.append(tex2mathml(node.astext(), as_block=False))
    raise nodes.SkipNode


def block_mathml(self: Any, node: nodes.math_block) -> None:
    """Write a formula of its own."""
    self.body.append(f'<div class="math">{tex2mathml(node.astext(), as_block=True)}</div>')
    raise nodes.SkipNode


class BothThemes(SphinxTransform):
    """Puts the dark form of a figure beside the light one, for the theme to choose.

    Pages name `<figure>-light.svg` alone, so that they read well elsewhere, too.
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
    """Google's form, but for types: they stand in the signatures and nowhere else.

    So "int64, shape (n,): the steps" under "Returns:" is text as a whole.
    """

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
        with contextlib.suppress(NameError):  # in the bases of Gymnasium's vector environments
            hints = typing.get_type_hints(self._obj) if isinstance(self._obj, type) else {}
        return stringify_annotation(hints[_name], "smart") if _name in hints else ""


def read_docstring(
    app: Sphinx, what: str, name: str, thing: object, options: object, lines: list[str]
) -> None:
    """Turn a docstring into reStructuredText."""
    if what == "data":
        lines[:] = text_under_constant(name.rpartition(".")[2])
    # Napoleon takes what an attribute's first line has before a colon for a type.
    kind = "method" if what in ("attribute", "data", "property") else what
    parsed = Docstring(list(lines), Config(), app, kind, name, thing, options).lines()
    lines.clear()
    for line in parsed:
        # Gymnasium's habit; Sphinx knows headings on pages alone.
        heading = re.match(r"## (.+)", line)
        lines += ["", f".. rubric:: {heading[1]}", ""] if heading else [line]


def leave_out_object(app: Sphinx, domain: str, kind: str, content: nodes.Element) -> None:
    """Leave out the line that says of a class that it is based on nothing."""
    if kind == "class" and len(content) and content[0].astext() == "Bases: object":
        del content[0]


def text_under_constant(name: str) -> list[str]:
    """What stands under a constant, in whichever module it is defined."""
    for module in sorted(sys.modules):
        if module.split(".")[0] == DroneSwarmSearch.__name__:
            told = ModuleAnalyzer.for_module(module).find_attr_docs()
            if ("", name) in told:
                return told["", name]
    return []


def evaluate_types(app: Sphinx) -> None:
    """Evaluate constructors' annotations; autodoc does so for all other functions."""
    for found in pkgutil.walk_packages(DroneSwarmSearch.__path__, "DroneSwarmSearch."):
        if found.name.rpartition(".")[2] in ("__main__", "sb3"):
            continue  # one is run by its import, the other imports a trainer
        for thing in vars(importlib.import_module(found.name)).values():
            if isinstance(thing, type) and thing.__module__ == found.name:
                made = vars(thing).get("__init__")
                if isinstance(made, types.FunctionType):
                    made.__annotations__ = typing.get_type_hints(made)


def name_public_bases(
    app: Sphinx, name: str, thing: type, options: object, bases: list[Any]
) -> None:
    """Name the bases of private classes in their place."""
    for base in list(bases):
        kind = typing.get_origin(base) or base
        if not kind.__module__.startswith(DroneSwarmSearch.__name__):
            continue
        package = sys.modules[kind.__module__.rpartition(".")[0]]
        if not hasattr(package, kind.__name__):
            place = bases.index(base)
            bases[place : place + 1] = kind.__bases__
    bases[:] = [base for base in bases if (typing.get_origin(base) or base) is not Generic]


def leave_out(
    app: Sphinx, what: str, name: str, thing: object, skip: bool, options: object
) -> bool | None:
    """Leave out fields of named tuples, which the class's docstring describes."""
    return True if type(thing).__name__ == "_tuplegetter" else None


def find_in_package(
    app: Sphinx, env: Any, node: addnodes.pending_xref, shown: nodes.Node
) -> nodes.Node | None:
    """Find what a docstring calls by the end of its name, `Scenario` or `rules.Action`."""
    target = node.get("reftarget", "").removesuffix("()")
    if node.get("refdomain") != "py" or not re.fullmatch(r"[\w.]+", target):
        return None
    objects = env.domains["py"].objects
    whole = objects.get(f"{DroneSwarmSearch.__name__}.{target}")
    named = [entry for name, entry in objects.items() if name.endswith(f".{target}")]
    found = {(entry.docname, entry.node_id) for entry in ([whole] if whole else named)}
    # A name in small letters is an argument's, unless it says of what module it is.
    if len(found) != 1 or not re.search("[A-Z]|[.]" if whole else "[A-Z]", target):
        return None
    document, anchor = found.pop()
    return make_refnode(app.builder, node["refdoc"], document, anchor, [shown], target)


class CommandHelp(Directive):
    """What `python -m DroneSwarmSearch COMMAND --help` prints."""

    optional_arguments = 1

    def run(self) -> list[nodes.Node]:
        os.environ.update(COLUMNS="88", NO_COLOR="1")
        with contextlib.redirect_stdout(io.StringIO()) as told, contextlib.suppress(SystemExit):
            DroneSwarmSearch.__main__.main([*self.arguments, "--help"])
        return [nodes.literal_block(told.getvalue(), told.getvalue(), language="text")]


def setup(app: Sphinx) -> None:
    """Add what Sphinx lacks."""
    app.add_html_math_renderer("mathml", (inline_mathml, None), (block_mathml, None))
    app.add_transform(BothThemes)
    app.add_directive("command-help", CommandHelp)
    app.connect("builder-inited", evaluate_types)
    app.connect("autodoc-process-bases", name_public_bases)
    app.connect("autodoc-process-docstring", read_docstring)
    app.connect("autodoc-skip-member", leave_out)
    app.connect("object-description-transform", leave_out_object)
    app.connect("missing-reference", find_in_package)
