"""The policy "imitation": one small network that imitates plans, run in NumPy."""

from __future__ import annotations

import copy
from collections.abc import Sequence
from dataclasses import replace
from functools import lru_cache, partial
from pathlib import Path

import numpy as np

from DroneSwarmSearch._internal import checks
from DroneSwarmSearch._internal.arrays import Singles
from DroneSwarmSearch._internal.cells import cell_number
from DroneSwarmSearch.core.collision_avoidance import choose_in_turn
from DroneSwarmSearch.core.grid import Cell
from DroneSwarmSearch.core.rules import Action
from DroneSwarmSearch.core.scenario import Scenario
from DroneSwarmSearch.policies.arrivals import INPUTS, TURNS, VIEWS, Arrivals
from DroneSwarmSearch.policies.base import OWN
from DroneSwarmSearch.policies.belief_tracker import BeliefTracker
from DroneSwarmSearch.policies.gains import SearchGains
from DroneSwarmSearch.policies.greedy import ForecastGreedyPolicy
from DroneSwarmSearch.policies.open_loop import Act, OpenLoopMemory, OpenLoopPolicy, PlanStep

SAMPLES = 4  # simulations with sampled actions before a search

TEMPERATURE = 0.5
"""Factor on the Gumbel noise of a sample: with 1 it follows the network's probabilities."""

OUTPUTS = 2
"""Outputs of the network in each view: the scores of flying straight ahead and of searching."""

DEFAULT_WEIGHTS = Path(__file__).with_name("imitation.npz")
"""The file of the packaged weights."""


class Network:
    """A multilayer perceptron with ReLU activations that scores each direction in the same way.

    It observes a drone's inputs in four views, one for each direction (`arrivals.VIEWS`), and
    has two outputs: the logit of flying straight ahead in that view, and one for searching,
    whose mean over the four views counts. The last layer also gets the inputs themselves. The
    layers are weights and biases: float32, shapes (inputs, outputs) and (outputs,).

    Raises:
        ValueError: the layers do not fit each other, the inputs or the outputs.
    """

    def __init__(self, layers: Sequence[tuple[Singles, Singles]]) -> None:
        width = INPUTS
        last = len(layers) - 1
        for number, (weights, biases) in enumerate(layers):
            width += INPUTS * (number == last > 0)
            if biases.ndim != 1 or weights.shape != (width, len(biases)):
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
        """The logits of the moves and of searching, indexed by `Action`: float32, shape (n, 5).

        The inputs are those of `Arrivals`: float32, shape (n, INPUTS). Idling has no logit.
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
            arrays[f"weights{number}"] = weights
            arrays[f"biases{number}"] = biases
        with Path(path).open("wb") as file:
            np.savez_compressed(file, **arrays)  # type: ignore[arg-type]  # NumPy's stub

    @classmethod
    def load(cls, path: str | Path) -> Network:
        """Read a network that `save` has written. Nothing is unpickled."""
        try:
            with Path(path).open("rb") as opened, np.load(opened, allow_pickle=False) as file:
                arrays = {name: np.asarray(array, np.float32) for name, array in file.items()}
            if not all(np.isfinite(array).all() for array in arrays.values()):
                raise ValueError("its numbers must be finite")
            layers = range((len(arrays) + 1) // 2)
            return cls([(arrays[f"weights{k}"], arrays[f"biases{k}"]) for k in layers])
        except FileNotFoundError:
            raise
        except Exception as error:  # zipfile, zlib and NumPy raise many types for damaged files
            raise ValueError(f"{path} must hold a network's weights: {error!r}") from error


@lru_cache(maxsize=64)
def _arrivals(grid_size: int, n_drones: int) -> Arrivals:
    """The inputs for a grid and a number of drones; they hold no state."""
    return Arrivals(grid_size, n_drones)


class ImitationPolicy(OpenLoopPolicy):
    """A network trained to imitate the plans of random searches; every drone runs a copy of it.

    `examples/train_imitation.py` trains it: the plans start from the network's own paths, and the
    next network learns from them.

    The policy tracks the posterior itself. Each drone observes what searching a cell gains
    (`SearchGains`) at the time of its arrival there (`Arrivals`), and the network computes the
    logits of its actions. The drones take their best actions in turn (`choose_in_turn`). With a
    `radio_range`, each drone chooses for itself and for those in range, from what it knows.

    Where all drones hear each other and a find teaches nothing about the others, a search can be
    simulated exactly until it. Before the first step, the policy simulates the search with the
    network's best actions, with `samples` samples of its actions, and with greedy search on the
    forecast (`ForecastGreedyPolicy`). It follows the most successful simulation until a find, and
    then simulates the rest without samples. With one person, it is therefore at least as successful
    as each of them (parallel rollout: H. S. Chang, R. Givan, E. K. P. Chong, Discrete Event Dynamic
    Systems 14:309, 2004). In all other searches, the drones follow the network in every step.

    Source: T. Anthony, Z. Tian, D. Barber, Thinking fast and slow with deep learning and tree
    search, NIPS 2017.

    Args:
        scenario: the parameters of every search to steer.
        weights: a file written by `Network.save`; by default the packaged weights.
        samples: see above, at least 0; or None to follow the network in every step.

    Raises:
        FileNotFoundError: the file does not exist.
        TypeError: `scenario` is not a `Scenario`, or `samples` is not an integer.
        ValueError: the file does not hold a valid network, or `samples` is negative.
    """

    knows = OWN

    def __init__(
        self, scenario: Scenario, weights: str | Path | None = None, samples: int | None = SAMPLES
    ) -> None:
        super().__init__(scenario)
        self._samples = 0 if samples is None else checks.integer("samples", samples, 0)
        find_teaches = scenario.shared_drift and scenario.mission == "rescue"
        is_known = not find_teaches and scenario.radio_range is None
        self._simulates = samples is not None and is_known
        self._network = Network.load(DEFAULT_WEIGHTS if weights is None else weights)
        self._greedy = ForecastGreedyPolicy(scenario)

    def choose(self, memory: OpenLoopMemory, cells: list[Cell], matrix: Singles) -> Sequence[int]:
        if self._simulates:
            return super().choose(memory, cells, matrix)
        memory.tracker.observe(matrix)
        return self._preferred(memory.tracker, cells)

    def notice(self, memory: OpenLoopMemory, drones: list[int]) -> None:
        memory.tracker.in_range = tuple(drones)

    def plan(
        self, tracker: BeliefTracker, cells: list[Cell], rest: Sequence[PlanStep] = ()
    ) -> list[PlanStep]:
        """The most successful simulation of the rest of a search."""
        tracker = copy.deepcopy(tracker)
        # In a coverage mission nobody is found, as in the simulations.
        tracker.scenario = replace(self.scenario, mission="coverage")
        candidates: list[Act] = [self._preferred, self._greedy.actions]
        if tracker.step == 0:  # after a find, samples for all continuations would take too long
            samples = map(np.random.default_rng, range(self._samples))
            candidates += [partial(self._preferred, rng=rng) for rng in samples]
        simulations = [self.simulated(act, tracker, cells) for act in candidates]
        success = np.prod if self.scenario.mission == "rescue" else np.mean
        return max(simulations, key=lambda simulation: float(success(simulation[1])))[0]

    def _preferred(
        self, tracker: BeliefTracker, cells: list[Cell], rng: np.random.Generator | None = None
    ) -> list[int]:
        """The actions that the network prefers; with `rng` a sample."""
        limit = self.scenario.timestep_limit
        size = self.scenario.grid_size
        remaining = max(limit - tracker.step, 1)
        positions = np.array([cells])
        arrivals = _arrivals(size, len(cells))
        gains = SearchGains(tracker, arrivals.steps(remaining) + 1).beside([])
        detections = [self.scenario.detections[person] for person in tracker.missing]
        detection = np.array([sum(detections) / len(detections)])
        headings = [tracker.headings[drone] for drone in tracker.in_range]
        headings += [int(Action.IDLE)] * (len(cells) - len(headings))  # of one that is not heard
        inputs = arrivals.inputs(
            gains[None], positions, np.array([remaining]), limit, detection, np.array([headings])
        )
        logits = self._network(inputs[0])
        if rng is not None:
            logits += (TEMPERATURE * rng.gumbel(size=logits.shape)).astype(np.float32)
        numbers = cell_number(positions[..., 0], positions[..., 1], size)
        chosen, _ = choose_in_turn(logits[None], numbers, size, tracker.scenario.crash)
        actions: list[int] = chosen[0].tolist()
        return actions
