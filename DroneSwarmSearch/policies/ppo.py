"""A policy trained by proximal policy optimisation (PPO): one small network, run in NumPy.

`examples/train_ppo.py` trained the packaged weights, `ppo.npz`; docs/guides/training.md has the
command, the training time and the learning curve.
"""

from __future__ import annotations

import copy
import zipfile
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass, replace
from functools import lru_cache, partial
from pathlib import Path
from typing import Literal, NamedTuple

import numpy as np
from numpy.typing import NDArray

from DroneSwarmSearch._internal import checks
from DroneSwarmSearch._internal.grid import grid_of
from DroneSwarmSearch.policies.arrivals import INPUTS, TURNS, VIEWS, Arrivals
from DroneSwarmSearch.policies.base import SwarmPolicy
from DroneSwarmSearch.policies.belief_tracker import BeliefTracker
from DroneSwarmSearch.policies.greedy import ForecastGreedyPolicy
from DroneSwarmSearch.policies.shared_plans import HORIZON, PlanMemory, SharedPlans
from DroneSwarmSearch.rules import Action
from DroneSwarmSearch.scenario import Cell, Scenario
from DroneSwarmSearch.wrappers.masks import choose_in_turn

__all__ = ["DEFAULT_WEIGHTS", "Network", "PPOPolicy"]

Singles = NDArray[np.float32]

SAMPLES = 4
"""Simulations with sampled actions before a search."""

TEMPERATURE = 0.5
"""Factor on the Gumbel noise of a sample: with 1 it follows the network's probabilities."""

OUTPUTS = 2
"""Outputs of the network in each view: the scores of flying straight ahead and of searching."""

MAX_BYTES = 2**28
"""The most bytes of weights to read, so that no file can exhaust the memory."""

DEFAULT_WEIGHTS = Path(__file__).with_name("ppo.npz")
"""The packaged weights."""


_Act = Callable[[BeliefTracker, list[Cell]], list[int]]
"""The actions of one step, given the beliefs and every drone's cell."""


class Network:
    """A multilayer perceptron with ReLU activations that scores each direction in the same way.

    It observes a drone's inputs in four views, one for each direction (`arrivals.VIEWS`), and
    has two outputs: the logit of flying straight ahead in that view, and one for searching,
    whose mean over the four views counts. Turning a search by a right angle therefore turns the
    logits. The last layer also gets the inputs themselves, next to the last hidden units.

    Args:
        layers: the weights and biases of each layer: float32, shapes (inputs, outputs) and
            (outputs,).

    Raises:
        ValueError: the layers do not fit each other, the inputs or the outputs.
    """

    def __init__(self, layers: Sequence[tuple[Singles, Singles]]) -> None:
        width, last = INPUTS, len(layers) - 1
        for number, (weights, biases) in enumerate(layers):
            width += INPUTS * (number == last > 0)
            if weights.ndim != 2 or biases.ndim != 1 or weights.shape != (width, len(biases)):
                raise ValueError(
                    f"layers[{number}] must have weights of shape ({width}, outputs) and as many "
                    f"biases as outputs, got {weights.shape} and {biases.shape}"
                )
            width = len(biases)
        if not layers or width != OUTPUTS:
            raise ValueError(
                f"layers must end in {OUTPUTS} outputs, one for flying ahead and one for "
                f"searching, got {width}"
            )
        self._layers = [(np.float32(weights), np.float32(biases)) for weights, biases in layers]

    def __call__(self, inputs: Singles) -> Singles:
        """The logits of the moves and of searching, indexed by `Action`; idling has none.

        Args:
            inputs: see `Arrivals`: float32, shape (n, INPUTS).

        Returns:
            float32, shape (n, 5).
        """
        views = hidden = inputs[:, VIEWS]
        for weights, biases in self._layers[:-1]:
            hidden = np.maximum(hidden @ weights + biases, 0.0)
        weights, biases = self._layers[-1]
        seen = views if len(self._layers) == 1 else np.concatenate([hidden, views], axis=2)
        outputs = seen @ weights + biases
        logits = np.empty((len(inputs), len(TURNS) + 1), np.float32)
        logits[:, TURNS] = outputs[..., 0]
        logits[:, Action.SEARCH] = outputs[..., 1].mean(axis=1)
        return logits

    def save(self, path: str | Path) -> None:
        """Write the weights to an .npz file: weights0, biases0, weights1 and so on."""
        arrays = {}
        for number, (weights, biases) in enumerate(self._layers):
            arrays[f"weights{number}"], arrays[f"biases{number}"] = weights, biases
        with Path(path).open("wb") as file:
            np.savez_compressed(file, **arrays)  # type: ignore[arg-type]  # NumPy's stub

    @classmethod
    def load(cls, path: str | Path) -> Network:
        """Read a network that `save` has written. Nothing is unpickled.

        Raises:
            FileNotFoundError: the file does not exist.
            ValueError: it does not hold a valid network.
        """
        try:
            with zipfile.ZipFile(path) as archive:
                arrays = dict(_arrays(archive))
            count = len(arrays) // 2
            names = [f"{kind}{number}" for number in range(count) for kind in ("weights", "biases")]
            if not names or {*names} != {*arrays}:
                raise ValueError(
                    "it must hold the arrays weights0, biases0 and so on, "
                    f"got {', '.join(arrays) or 'none'}"
                )
            return cls([(arrays[f"weights{k}"], arrays[f"biases{k}"]) for k in range(count)])
        except FileNotFoundError:
            raise
        except Exception as error:  # zipfile, zlib and NumPy raise many types for damaged files
            why = str(error) or type(error).__name__
            raise ValueError(f"{path} must hold a network's weights: {why}") from error


def _arrays(archive: zipfile.ZipFile) -> Iterator[tuple[str, Singles]]:
    """The names and arrays of an .npz file, read without trusting its headers."""
    total = sum(member.file_size for member in archive.infolist())
    if total > MAX_BYTES:
        raise ValueError(f"its arrays must have at most {MAX_BYTES} bytes, got {total}")
    for member in archive.infolist():
        # Other methods may expand beyond the size that the file states.
        if member.compress_type not in (zipfile.ZIP_STORED, zipfile.ZIP_DEFLATED):
            raise ValueError(f"{member.filename} must be stored or deflated, as NumPy writes it")
        with archive.open(member) as file:
            version = np.lib.format.read_magic(file)
            if version not in _READ_HEADER:
                raise ValueError(f"{member.filename} must be of format 1.0 or 2.0, got {version}")
            shape, fortran_order, dtype = _READ_HEADER[version](file)
            if dtype.kind != "f":
                raise ValueError(f"{member.filename} must hold real numbers, got {dtype}")
            values = np.frombuffer(file.read(), dtype)
            with np.errstate(over="ignore"):  # overflow gives infinity, which is rejected below
                array = values.astype(np.float32)
        if not np.isfinite(array).all():
            raise ValueError(f"{member.filename} must hold finite numbers")
        order: Literal["C", "F"] = "F" if fortran_order else "C"
        yield member.filename.removesuffix(".npy"), array.reshape(shape, order=order)


_READ_HEADER = {
    (1, 0): np.lib.format.read_array_header_1_0,
    (2, 0): np.lib.format.read_array_header_2_0,
}


class PPOPolicy(SwarmPolicy):
    """A network trained by PPO on randomly drawn searches; every drone runs a copy of it.

    The policy tracks the exact posterior itself, regardless of the matrix shown (`BeliefTracker`).
    Each drone observes the probability that searching a cell succeeds (POS) at the time of its
    arrival there (`Arrivals`), and the network computes the logits of its actions. The drones
    take their best actions in turn (`masks.choose_in_turn`), so they never collide and never
    leave the grid.

    Until a person is found, an unsuccessful search can be simulated exactly. Before the first
    step, the policy therefore simulates the search several times: with the network's best
    actions, with `samples` samples of its actions, and with greedy search on the forecast
    (`ForecastGreedyPolicy`). It follows the simulation with the greatest probability of success
    until a find, and then simulates the rest without samples. With one person, it is therefore at
    least as successful as each of them (parallel rollout: H. S. Chang, R. Givan,
    E. K. P. Chong, Discrete Event Dynamic Systems 14:309, 2004).

    Source: J. Schulman, F. Wolski, P. Dhariwal, A. Radford, O. Klimov, Proximal policy
    optimization algorithms, 2017.

    Args:
        scenario: the parameters of every search to steer.
        weights: a file written by `Network.save`; by default the packaged weights.
        samples: see above, at least 0; or None to follow the network in every step.

    Raises:
        FileNotFoundError: the file does not exist.
        TypeError: `scenario` is not a `Scenario`, or `samples` is not an integer.
        ValueError: the file does not hold a valid network, or `samples` is negative.
    """

    def __init__(
        self, scenario: Scenario, weights: str | Path | None = None, samples: int | None = SAMPLES
    ) -> None:
        super().__init__(scenario)
        self._samples = None if samples is None else checks.integer("samples", samples, 0)
        self._network = _default_network() if weights is None else Network.load(weights)
        self._arrivals = Arrivals(scenario.grid_size, scenario.n_drones)
        self._neighbours, self._positions = grid_of(scenario.grid_size)
        self._tracker = BeliefTracker(scenario)
        # In a coverage mission nobody is found, as in the simulations.
        self._coverage = replace(scenario, mission="coverage")
        self._plans: SharedPlans[_Plan] = SharedPlans()

    def begin(self) -> _Memory:
        return _Memory(copy.deepcopy(self._tracker))

    def choose(self, memory: _Memory, cells: list[Cell], matrix: Singles) -> Sequence[int]:
        tracker = memory.tracker
        tracker.observe(matrix)
        if self._samples is not None and tracker.missing != memory.missing:
            self._plans.give(memory, cells, lambda: self._best_plan(tracker, cells))
        actions = memory.planned(cells)
        if actions is None:
            actions = self._preferred(tracker, cells)
        tracker.update(cells, actions)
        return actions

    def _preferred(
        self, tracker: BeliefTracker, cells: list[Cell], rng: np.random.Generator | None = None
    ) -> list[int]:
        """The actions that the network prefers; with `rng` a sample."""
        limit, size = self.scenario.timestep_limit, self.scenario.grid_size
        remaining = max(limit - tracker.step, 1)
        ahead = tracker.success_ahead(self._arrivals.steps(remaining))
        positions = np.array([cells])
        detections = [self.scenario.detections[person] for person in tracker.missing]
        detection = np.array([sum(detections) / len(detections)])
        inputs = self._arrivals.inputs(
            ahead[None], positions, np.array([remaining]), limit, detection
        )
        logits = self._network(inputs[0])
        if rng is not None:
            logits += (TEMPERATURE * rng.gumbel(size=logits.shape)).astype(np.float32)
        numbers = positions[..., 1] * size + positions[..., 0]
        actions: list[int] = choose_in_turn(logits[None], numbers, size)[0][0].tolist()
        return actions

    def _best_plan(self, tracker: BeliefTracker, cells: list[Cell]) -> _Plan:
        """The most successful simulation of the rest of a search."""
        greedy = ForecastGreedyPolicy(self._coverage)

        def act_greedily(tracker: BeliefTracker, cells: list[Cell]) -> list[int]:
            return [*map(int, greedy.choose(copy.deepcopy(tracker), cells, tracker.matrix()))]

        candidates: list[_Act] = [self._preferred, act_greedily]
        if tracker.step == 0:  # after a find, samples for all continuations would take too long
            for seed in range(self._samples or 0):
                candidates.append(partial(self._preferred, rng=np.random.default_rng(seed)))
        plans = [self._simulated(act, tracker, cells) for act in candidates]
        return max(plans, key=lambda plan: plan.success)

    def _simulated(self, act: _Act, tracker: BeliefTracker, cells: list[Cell]) -> _Plan:
        """The search until the time limit, or for `HORIZON` steps, if nobody is found."""
        size, missing = self.scenario.grid_size, tracker.missing
        tracker = copy.deepcopy(tracker)
        tracker.scenario = self._coverage
        unfound = dict.fromkeys(missing, 1.0)
        remaining = max(self.scenario.timestep_limit - tracker.step, 1)
        steps = []
        for _ in range(min(remaining, HORIZON)):
            actions = act(tracker, cells)
            steps.append((cells, actions))
            numbers = [y * size + x for x, y in cells]
            searched = [
                cell
                for cell, action in zip(numbers, actions, strict=True)
                if action == Action.SEARCH
            ]
            if searched:
                for person in missing:
                    unfound[person] *= 1.0 - tracker.chance_of_find(person, searched)
            tracker.update(cells, actions)
            moved = zip(numbers, actions, strict=True)
            cells = [self._positions[self._neighbours[cell][action]] for cell, action in moved]
        found = 1.0 - np.array([*unfound.values()])
        is_rescue = self.scenario.mission == "rescue"
        return _Plan(float(found.prod() if is_rescue else found.mean()), steps)


class _Plan(NamedTuple):
    """A simulated search.

    Attributes:
        success: the probability that it finds all persons; in a coverage mission, the mean over
            persons.
        steps: the drones' cells and actions in every step.
    """

    success: float
    steps: list[tuple[list[Cell], list[int]]]


@dataclass
class _Memory(PlanMemory[_Plan]):
    """A search and the simulation to follow until a find."""

    def planned(self, cells: list[Cell]) -> list[int] | None:
        """The actions of this step in the plan; None where the search has left the plan."""
        step = self.tracker.step - self.first
        if self.plan is None or step >= len(self.plan.steps):
            return None
        expected, actions = self.plan.steps[step]
        return actions if expected == cells else None


@lru_cache(maxsize=1)
def _default_network() -> Network:
    return Network.load(DEFAULT_WEIGHTS)
