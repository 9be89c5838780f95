"""Policies on stage: what they see of the searches of a batch, and the actions they return."""

from __future__ import annotations

import copy
from collections.abc import Callable, Mapping
from typing import Any

import numpy as np

from DroneSwarmSearch._internal.arrays import Ints
from DroneSwarmSearch.core.actions import checked_actions, read_actions
from DroneSwarmSearch.core.grid import Grid
from DroneSwarmSearch.core.named_search import NamedSearch
from DroneSwarmSearch.evaluation.policy_spec import PolicySpec
from DroneSwarmSearch.layouts.view import View
from DroneSwarmSearch.policies.base import ALL, BatchPolicy
from DroneSwarmSearch.vector.engine import SearchBatch
from DroneSwarmSearch.vector.observations import BatchObservations

PolicyLike = Callable[[Any], Any]

UNSTATED = (
    "the policy states no view, so it was shown all drones of all searches: if it expects another "
    "one, give it an attribute view, such as view = View('drone', 'flat'), or pass view="
)


def view_of(spec: PolicySpec, search: NamedSearch, view: View | str | None) -> View:
    """What a policy sees: `view`; without a form, also what the policy's attribute `view` states.

    Raises ValueError if the policy is one of this package and cannot take the view.
    """
    given = view if isinstance(view, View) else View(view)
    if issubclass(spec.kind, BatchPolicy):
        if given.form == "drone" or given.observation != "dict" or given.action_mask:
            raise ValueError(
                "view must be 'swarm' or 'parallel', with observation='dict' and without masks, "
                f"for {spec.name}, got {given!r}"
            )
        return given.over(View("swarm", hears_all=spec.kind.knows == ALL))
    if given.form is not None:
        return given
    own = getattr(spec.make(search.scenario), "view", None)
    return given.over(own if isinstance(own, View) else View(own))


def steering(
    policy: PolicyLike, search: NamedSearch, seed: int, view: View
) -> Callable[[], dict[str, int]]:
    """Steer an episode of a `DroneSwarmSearch` with this seed: each call returns actions, in turn.

    A batch of one row plays the same episode, to show the policy its view.
    """
    batch = SearchBatch(1, **search.parameters)
    batch.reset([seed])
    stage = Stage(batch, view)
    names = [f"drone{i}" for i in range(search.scenario.n_drones)]
    reset_policy(policy, seed if view.form == "parallel" else [seed])

    def act() -> dict[str, int]:
        actions = stage.actions(policy, np.arange(1))
        batch.step(actions)
        return dict(zip(names, actions[0].tolist(), strict=True))

    return act


def prepared(spec: PolicySpec, search: NamedSearch) -> PolicyLike:
    """A policy for a search, which may look at it before the first episode.

    Yardsticks that know what all drones know are made for a search in which all hear each other.
    """
    scenario = search.scenario
    if issubclass(spec.kind, BatchPolicy) and spec.kind.knows == ALL:
        scenario = scenario.replace(radio_range=None)
    policy = spec.make(scenario)
    getattr(policy, "prepare", lambda drones: None)(search.drones)
    return policy


def copied(policy: PolicyLike) -> PolicyLike:
    """A copy; the policy itself if it cannot be copied."""
    try:
        return copy.deepcopy(policy)
    except TypeError:  # it holds a lock or a file, for example
        return policy


def reset_policy(policy: PolicyLike, seed: int | list[int]) -> None:
    """Call the policy's `reset`, if it has one."""
    getattr(policy, "reset", lambda seed: None)(seed=seed)


class Stage:
    """Shows the searches of a batch to a policy with a view, and reads its actions."""

    def __init__(self, batch: SearchBatch, view: View) -> None:
        self._batch = batch
        self._view = view
        scenario = batch.scenario_of(0)
        self._names = tuple(f"drone{i}" for i in range(scenario.n_drones))
        self._size = scenario.grid_size
        self._neighbours = Grid.of(scenario.grid_size).neighbours
        self._observations = BatchObservations(batch, view)
        self._every = np.arange(batch.num_rows)

    def actions(self, policy: PolicyLike, rows: Ints) -> Ints:
        """The policy's validated actions in some rows: int64, (n, n_drones)."""
        if getattr(policy, "remembers", False) and len(rows) < len(self._every):
            return self.actions(policy, self._every)[rows]
        observations: Any = self._observations.of_rows(rows)
        if self._view.form == "parallel":
            observations = self._by_drone(observations)
        elif self._view.form != "drone" and self._view.observation == "dict":
            layout = observations["observation"] if self._view.action_mask else observations
            layout["row"] = rows.copy()
        try:
            returned = policy(observations)
        except Exception as error:  # whatever it raises for observations that it does not expect
            if self._view.form is None and hasattr(error, "add_note"):  # Python 3.11 or later
                error.add_note(UNSTATED)
            raise
        try:
            return self._read(returned, len(rows))
        except (TypeError, ValueError) as error:
            hint = "" if self._view.form else f"; {UNSTATED}"
            raise type(error)(f"the policy's {error}{hint}") from None

    def _by_drone(self, observations: Any) -> dict[str, Any]:
        """The observations of one search in the form of `DroneSwarmSearch`."""
        layout = observations["observation"] if self._view.action_mask else observations
        size = self._size
        # one for all drones, or one for each
        shown = layout["probability_matrix"][0].reshape(-1, size, size)
        shown.flags.writeable = False
        matrices = [*shown]
        seen: dict[str, Any] = {}
        for drone, cell in enumerate(layout["positions"][0].tolist()):
            matrix = matrices[drone % len(matrices)]
            own: dict[str, Any] = {"observation": (tuple(cell), matrix)}
            if self._view.action_mask:
                own = {"observation": own, "action_mask": observations["action_mask"][0, drone]}
            seen[self._names[drone]] = own
        return seen

    def _read(self, actions: Any, n: int) -> Ints:
        drones = len(self._names)
        if self._view.form == "parallel":
            cells = self._batch.cells[0].tolist()
            chosen, _ = read_actions(actions, self._names, self._neighbours, cells)
            return np.array([[*chosen]])
        if isinstance(actions, Mapping):
            raise TypeError(
                f"actions must be an array of integers with view={self._view.form or 'swarm'!r}, "
                f"got {actions!r:.200}"
            )
        shape = (n, drones) if self._view.form != "drone" else (n * drones,)
        return checked_actions(actions, shape, np.int64).reshape(n, drones)
