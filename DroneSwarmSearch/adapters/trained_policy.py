"""What the adapters share: trained networks as policies for `evaluate`, and infos as lists."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np
from numpy.typing import NDArray

from DroneSwarmSearch._internal import checks
from DroneSwarmSearch.layouts.view import View

LEAST_LOGIT = -1e9  # the logit of masked actions; their probability is 0 in float32


class TrainedPolicy:
    """A trained network as a policy for `evaluation.evaluate`.

    Args:
        logits: a callable from the observations of M drones (or swarms), in the form of
            `evaluate`, to the logits of their actions, shape (M, 6) (or (M, n_drones, 6)), very low
            for masked actions. Each adapter has a function `logits` that makes one. If it remembers
            what it has seen, it has a method `reset()` that forgets it; see `remembers`.
        deterministic: whether to take the most likely actions. By default, actions are sampled,
            as PPO does while it learns; the samples follow from the seeds of the episodes.
        view: the form, the layout and the masks of the training.

    Attributes:
        remembers: whether `logits` has a method `reset`. Evaluations then show all searches in
            every step, in the same order, even those that have ended.

    Raises:
        TypeError: `deterministic` is not a bool.
    """

    def __init__(
        self,
        logits: Any,
        deterministic: bool = False,
        view: View = View(),  # noqa: B008 (it is frozen)
    ) -> None:
        self.view = view
        self._logits = logits
        self.remembers = hasattr(logits, "reset")
        self._deterministic = checks.boolean("deterministic", deterministic)
        self.reset(seed=0)

    def reset(self, seed: int | Sequence[int], rows: None = None) -> None:
        """Begin episodes, with a seed of the sampling; `evaluate` calls this first."""
        self._generator = np.random.default_rng(seed)
        if self.remembers:
            self._logits.reset()

    def __call__(self, observations: Any) -> NDArray[np.int64]:
        """Actions, int64, shape (M,) or (M, n_drones)."""
        logits = self._logits(observations)
        if not self._deterministic:
            # The largest of logits with Gumbel noise is a sample from their softmax.
            logits = logits + self._generator.gumbel(size=logits.shape)
        actions: NDArray[np.int64] = logits.argmax(axis=-1)
        return actions


def listed(infos: Mapping[str, NDArray[Any]]) -> list[dict[str, Any]]:
    """What trainers log of the infos of a vector environment, for each sub-environment."""
    names = [name for name in ("is_success", "probability_of_success") if name in infos]
    columns = [infos[name].tolist() for name in names]
    return [dict(zip(names, values, strict=True)) for values in zip(*columns, strict=True)]
