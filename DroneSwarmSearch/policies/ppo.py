"""A trained policy: a small network, one copy for every drone, run in NumPy alone.

The weights that come with the package, `ppo.npz`, were made by `examples/train_ppo.py`;
docs/guides/training.md has the command, the time it took and the learning curve.
"""

from __future__ import annotations

import zipfile
from collections.abc import Iterator, Sequence
from functools import lru_cache
from pathlib import Path
from typing import Literal

import numpy as np
from numpy.typing import NDArray

from DroneSwarmSearch.policies.knowledge import Knowledge
from DroneSwarmSearch.policies.swarm import SwarmPolicy
from DroneSwarmSearch.rules import Action
from DroneSwarmSearch.scenario import Cell, Scenario
from DroneSwarmSearch.wrappers.crops import LENGTH, CropsLayout
from DroneSwarmSearch.wrappers.layouts import remaining_time_fraction
from DroneSwarmSearch.wrappers.masks import choose_in_turn

__all__ = ["Network", "PPOPolicy"]

Singles = NDArray[np.float32]

ACTIONS = len(Action) - 1
"""What is scored: moves and searching. Idling would never teach more than a search."""

LARGEST = 2**28
"""Bytes of weights that are read at most, so that no file can fill the memory."""

OWN_WEIGHTS = Path(__file__).with_name("ppo.npz")


class Network:
    """Dense layers with rectifiers between them: scores of actions from crops.

    Args:
        layers: the weights and the biases of each layer: float32, shapes (inputs, outputs)
            and (outputs,).

    Raises:
        ValueError: the layers do not fit each other, the layout or the actions.
    """

    def __init__(self, layers: Sequence[tuple[Singles, Singles]]) -> None:
        width = LENGTH
        for number, (weights, biases) in enumerate(layers):
            if weights.ndim != 2 or biases.ndim != 1 or weights.shape != (width, len(biases)):
                raise ValueError(
                    f"layers[{number}] must have weights of shape ({width}, outputs) and as many "
                    f"biases as outputs, got {weights.shape} and {biases.shape}"
                )
            width = len(biases)
        if not layers or width != ACTIONS:
            raise ValueError(
                f"layers must end in {ACTIONS} outputs, one for each action but idling, got {width}"
            )
        self._layers = [(np.float32(weights), np.float32(biases)) for weights, biases in layers]

    def __call__(self, crops: Singles) -> Singles:
        """The scores of the actions: float32, shape (n, 5), for crops of n drones."""
        values = crops
        for weights, biases in self._layers[:-1]:
            values = np.maximum(values @ weights + biases, 0.0)
        weights, biases = self._layers[-1]
        scores: Singles = values @ weights + biases
        return scores

    def save(self, path: str | Path) -> None:
        """Keep the weights in a file of NumPy's, arrays alone: weights0, biases0, weights1..."""
        arrays = {}
        for number, (weights, biases) in enumerate(self._layers):
            arrays[f"weights{number}"], arrays[f"biases{number}"] = weights, biases
        with Path(path).open("wb") as file:
            np.savez_compressed(file, **arrays)  # type: ignore[arg-type]  # of the stub

    @classmethod
    def load(cls, path: str | Path) -> Network:
        """A network from a file that `save` has written; nothing in it is unpickled.

        Raises:
            FileNotFoundError: there is no such file.
            ValueError: it holds no such network.
        """
        try:
            with zipfile.ZipFile(path) as archive:
                arrays = dict(_arrays(archive))
            count = len(arrays) // 2
            names = [f"{what}{number}" for number in range(count) for what in ("weights", "biases")]
            if not names or {*names} != {*arrays}:
                raise ValueError(
                    "it must hold the arrays weights0, biases0 and so on, "
                    f"got {', '.join(arrays) or 'none'}"
                )
            return cls([(arrays[f"weights{k}"], arrays[f"biases{k}"]) for k in range(count)])
        except FileNotFoundError:
            raise
        except Exception as error:  # of a damaged file zipfile, zlib and NumPy raise many kinds
            why = str(error) or type(error).__name__
            raise ValueError(f"{path} must hold a network's weights: {why}") from error


def _arrays(archive: zipfile.ZipFile) -> Iterator[tuple[str, Singles]]:
    """The arrays of a file of NumPy's by their names; no larger than the file says it is."""
    total = sum(member.file_size for member in archive.infolist())
    if total > LARGEST:
        raise ValueError(f"its arrays must have at most {LARGEST} bytes, got {total}")
    for member in archive.infolist():
        # Others can expand without limit, whatever size the file states.
        if member.compress_type not in (zipfile.ZIP_STORED, zipfile.ZIP_DEFLATED):
            raise ValueError(f"{member.filename} must be stored or deflated, as NumPy writes it")
        with archive.open(member) as file:
            version = np.lib.format.read_magic(file)
            if version not in _HEADERS:
                raise ValueError(f"{member.filename} must be of format 1.0 or 2.0, got {version}")
            shape, by_columns, dtype = _HEADERS[version](file)
            if dtype.kind != "f":
                raise ValueError(f"{member.filename} must hold real numbers, got {dtype}")
            values = np.frombuffer(file.read(), dtype)
            with np.errstate(over="ignore"):  # infinite then, which is refused
                array = values.astype(np.float32)
        if not np.isfinite(array).all():
            raise ValueError(f"{member.filename} must hold finite numbers")
        order: Literal["C", "F"] = "F" if by_columns else "C"
        yield member.filename.removesuffix(".npy"), array.reshape(shape, order=order)


_HEADERS = {
    (1, 0): np.lib.format.read_array_header_1_0,
    (2, 0): np.lib.format.read_array_header_2_0,
}


class PPOPolicy(SwarmPolicy):
    """A network trained by proximal policy optimisation, on searches drawn at random.

    Like `PosteriorGreedyPolicy` the swarm keeps the exact posterior itself, whatever the
    matrix shows (`Knowledge`). Every drone is given crops (`layouts.crops`) of how
    likely a search of each cell succeeds, and the network scores its actions. The drones
    choose their best ones in turn (`masks.choose_in_turn`), so none ever collides or leaves
    the grid.

    The network: J. Schulman, F. Wolski, P. Dhariwal, A. Radford, O. Klimov, Proximal policy
    optimization algorithms, 2017.

    Args:
        scenario: the parameters of every search that the policy is going to steer.
        weights: a file written by `Network.save`, as `examples/train_ppo.py` does; without
            it the weights that come with the package.

    Raises:
        FileNotFoundError: there is no such file.
        TypeError: `scenario` is no `Scenario`.
        ValueError: the file holds no such network.
    """

    def __init__(self, scenario: Scenario, weights: str | Path | None = None) -> None:
        super().__init__(scenario)
        self._network = _own() if weights is None else Network.load(weights)
        self._layout = CropsLayout(scenario.grid_size, scenario.n_drones)

    def begin(self) -> Knowledge:
        return Knowledge(self._scenario)

    def choose(self, memory: Knowledge, cells: list[Cell], matrix: Singles) -> Sequence[int]:
        memory.observe(matrix)
        success = memory.success
        if not success.any():  # a person who cannot be seen: anywhere is as good
            success[:] = 1.0
        positions = np.array([cells])
        left = remaining_time_fraction([memory.step], self._scenario.timestep_limit)
        seen = np.empty((1, len(cells), LENGTH), np.float32)
        self._layout.write(positions, success[None].astype(np.float32), left, seen)
        scores = self._network(seen[0])
        size = self._scenario.grid_size
        numbers = positions[..., 1] * size + positions[..., 0]
        actions: list[int] = choose_in_turn(scores[None], numbers, size)[0][0].tolist()
        memory.acted(cells, actions)
        return actions


@lru_cache(maxsize=1)
def _own() -> Network:
    return Network.load(OWN_WEIGHTS)
