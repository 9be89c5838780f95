"""The options of several commands that say what a policy sees."""

from __future__ import annotations

import argparse

from DroneSwarmSearch.layouts import LAYOUTS
from DroneSwarmSearch.layouts.view import FORMS, View


def add_view(parser: argparse.ArgumentParser) -> None:
    """The options of a `View`, but for what the matrix is."""
    add = parser.add_argument_group(
        "what your own policy sees (otherwise its attribute view)"
    ).add_argument
    add("--view", choices=FORMS, help="the form of observations and actions (default: what works)")
    add("--observation", choices=LAYOUTS, default="dict", help="the layout (default: dict)")
    add("--action-mask", action="store_true", help="also show it masks of valid actions")
    add("--right-of-way", action="store_true", help="these masks prevent all collisions")


def view_from(options: argparse.Namespace) -> View:
    """The `View` of these options and `--posterior`, where the command has it."""
    masks, posterior = (
        (options.action_mask, options.right_of_way),
        getattr(options, "posterior", None),
    )
    return View(options.view, options.observation, *masks, posterior)
