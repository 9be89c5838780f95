"""The networks of the rows "ippo" and "mappo", which benchmarks/suite_rows.py trains, in NumPy."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import numpy as np
from numpy.typing import NDArray

from DroneSwarmSearch import Scenario
from DroneSwarmSearch.adapters import TrainedPolicy
from DroneSwarmSearch.adapters.trained_policy import LEAST_LOGIT
from DroneSwarmSearch.evaluation import View

VIEW = View("drone", observation="crops", action_mask=True, right_of_way=True, bayesian_update=True)


class Perceptron(TrainedPolicy):
    """A multilayer perceptron with tanh activations, which samples each drone's action.

    `path`: an .npz file with weights0, (inputs, outputs), biases0, (outputs,), and so on.
    """

    def __init__(self, scenario: Scenario, path: str) -> None:
        with np.load(path) as arrays:
            layers = range(len(arrays) // 2)
            self._layers = [(arrays[f"weights{k}"], arrays[f"biases{k}"]) for k in layers]
        super().__init__(self._masked_logits, view=VIEW)

    def _masked_logits(self, shown: Mapping[str, NDArray[Any]]) -> NDArray[Any]:
        values = shown["observation"]
        for weights, biases in self._layers[:-1]:
            values = np.tanh(values @ weights + biases)
        weights, biases = self._layers[-1]
        logits = values @ weights + biases
        return np.where(shown["action_mask"], logits, LEAST_LOGIT)
