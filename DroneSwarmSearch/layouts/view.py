"""What a policy sees of a search, and the form of its actions."""

from __future__ import annotations

from dataclasses import dataclass, fields, replace
from typing import Any

from DroneSwarmSearch._internal import checks
from DroneSwarmSearch.core.scenario import Scenario
from DroneSwarmSearch.layouts import JOINT_LAYOUTS, LAYOUTS, Layout

FORMS = "swarm", "drone", "parallel"
TOP_CELLS = 8  # cells in the layout "top-cells", by default


@dataclass(frozen=True)
class View:
    """What a policy sees and returns.

    A policy may state its own: an attribute `view` of the callable.

    Attributes:
        form: "swarm": the observations of `SwarmVectorEnv` for the E episodes that have not
            ended, in the dict layout with their indices as "row"; actions of shape
            (E, n_drones). "drone": the observations of `DroneVectorEnv`; actions of shape
            (E * n_drones,). "parallel": the observations of `DroneSwarmSearch`, one episode at a
            time; a dict of actions. None: as the policy states, otherwise "swarm".
        observation: the layout for "swarm" and "drone": "dict", "flat", "planes", "top-cells"
            or "crops".
        action_mask: whether the policy gets masks of valid actions: {"observation": as above,
            "action_mask": int8}, shape (E, n_drones, 6) for "swarm", (E * n_drones, 6) for
            "drone"; for "parallel", each drone's mask has the shape (6,). See
            `wrappers.action_masks`.
        right_of_way: whether these masks prevent all collisions.
        bayesian_update: whether the policy sees the posterior, or the prior that only follows
            the drift; None: as in the search.
        top_cells: the number of cells in the layout "top-cells"; from 1 to grid_size².
        hears_all: whether the policy sees a search with a `radio_range` as if all drones heard each
            other: for yardsticks, such as the planner.

    Raises:
        ValueError: an attribute is out of range, or they cannot be combined.
    """

    form: str | None = None
    observation: str = "dict"
    action_mask: bool = False
    right_of_way: bool = False
    bayesian_update: bool | None = None
    top_cells: int = TOP_CELLS
    hears_all: bool = False

    def __post_init__(self) -> None:
        if self.form is not None:
            checks.choice("view", self.form, FORMS)
        checks.choice("observation", self.observation, tuple(LAYOUTS))
        if self.form == "parallel" and self.observation != "dict":
            raise ValueError(f"view='parallel' needs observation='dict', got {self.observation!r}")
        checks.integer("top_cells", self.top_cells, 1)
        if self.top_cells != TOP_CELLS and self.observation != "top-cells":
            raise ValueError(
                f"top_cells belongs to observation='top-cells', got {self.top_cells} with "
                f"observation={self.observation!r}"
            )
        if self.right_of_way and not self.action_mask:
            raise ValueError("right_of_way needs action_mask, which is False")

    @property
    def is_joint(self) -> bool:
        """Whether an observation shows a whole swarm."""
        return self.form != "drone"

    def layout(self, scenario: Scenario) -> Layout:
        """The layout for searches with the sizes of a scenario.

        Raises ValueError if `top_cells` are more than there are.
        """
        options: dict[str, Any] = {"radio": self.radio(scenario)}
        if self.observation == "top-cells":
            options |= {"k": self.top_cells, "name": "top_cells"}
        elif self.is_joint and self.observation in JOINT_LAYOUTS:
            options["joint"] = True
        return LAYOUTS[self.observation](scenario.grid_size, scenario.n_drones, **options)

    def radio(self, scenario: Scenario) -> bool:
        """Whether each drone of a search sees only what it has done and heard."""
        return scenario.radio_range is not None and not self.hears_all

    def over(self, other: View) -> View:
        """The other view, but with those attributes of this one that differ from their defaults."""
        values = {field.name: (getattr(self, field.name), field.default) for field in fields(self)}
        return replace(
            other, **{name: own for name, (own, usual) in values.items() if own != usual}
        )
