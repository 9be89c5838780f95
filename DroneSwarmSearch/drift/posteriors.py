"""The beliefs about all persons of a single search, updated in place."""

from __future__ import annotations

from array import array
from collections.abc import Collection, Sequence
from operator import add
from typing import Any

import numpy as np
from numpy.typing import NDArray

from DroneSwarmSearch.drift.belief import Floats, mean_over_missing, over_hypotheses
from DroneSwarmSearch.drift.probability_matrix import ProbabilityMatrix, belief_shape

__all__ = ["Posteriors"]


class _Posterior:
    """The belief about one person; its arrays are allocated once.

    Args:
        forecast: the person's forecast.
        detection: the person's probability of detection.

    Attributes:
        forecast: see above.
        detection: see above.
        belief: float64, shape (M, N, N).
        kept: the probability that no search so far finds the person.
    """

    def __init__(self, forecast: ProbabilityMatrix, detection: float) -> None:
        hypotheses, size = len(forecast.weights), forecast.grid_size
        self.forecast = forecast
        self.detection = detection
        self.belief = np.empty((hypotheses, size, size))
        self.kept = 1.0
        self._make_views()

    def _make_views(self) -> None:
        hypotheses, size, _ = self.belief.shape
        flat = self.belief.reshape(-1)
        shape = belief_shape(hypotheses, size)
        self._shaped = self.belief.reshape(shape)
        self._only = self.belief[0] if hypotheses == 1 else None
        self._rows = self.belief.reshape(-1, size)
        self._cells: Any = flat.data
        self._offsets = range(0, hypotheses * size**2, size**2)
        # The probabilities of staying, moving up and moving down, first along x, then along y.
        self._along_x, self._along_y = np.empty((2, 3, *shape))
        self._after_x = self._along_x[0]
        stay, up, down = self._along_x.reshape(3, -1)
        stay_y, up_y, down_y = self._along_y.reshape(3, -1)
        # Nobody leaves the grid, so arrays can be shifted as one run of memory.
        self._add_x = (stay[1:], up[:-1], stay[1:]), (stay[:-1], down[1:], stay[:-1])
        self._add_y = stay_y[size:], up_y[:-size], stay_y[size:]
        self._finish_y = stay_y[:-size], down_y[size:], flat[:-size]
        self._last_row, self._last_stay = flat[-size:], stay_y[-size:]

    def __getstate__(self) -> dict[str, Any]:
        """A copy makes its own views and scratch arrays."""
        names = ("forecast", "detection", "belief", "kept")
        return {name: self.__dict__[name] for name in names}

    def __setstate__(self, state: dict[str, Any]) -> None:
        self.__dict__.update(state)
        self._make_views()

    def start(self, step: int) -> None:
        """Set the belief to the forecast at a step."""
        self.forecast.write_joint(step, self.belief)
        self.kept = 1.0

    def search(self, searched: Collection[int]) -> None:
        """Apply the searches of a step, none of which finds the person; see `normalise`."""
        cells = self._cells
        missed = 1.0 - self.detection
        if len(self._offsets) > 1:
            searched = [cell + offset for offset in self._offsets for cell in searched]
        before = {cell: cells[cell] for cell in searched}
        for cell, value in before.items():
            cells[cell] = value * missed
        total = np.add.accumulate(np.add.reduce(self._rows, 0)).item(-1)
        if total > 0.0:
            np.multiply(self._shaped, 1.0 / total, self._shaped)
            self.kept *= min(total, 1.0)  # rounding must not lower the probability of success
        else:  # the searches contradict the belief, which stays
            for cell, value in before.items():
                cells[cell] = value
            self.kept = 0.0

    def drift(self, step: int) -> None:
        """Let the belief drift from a step to the next, see `belief.drift`."""
        along_x, along_y = self.forecast.block(step).flows_at(step)
        np.multiply(self._shaped, along_x, self._along_x)
        for terms in self._add_x:
            np.add(*terms)
        np.multiply(self._after_x, along_y, self._along_y)
        np.add(*self._add_y)
        np.add(*self._finish_y)
        self._last_row[...] = self._last_stay

    def over_hypotheses(self) -> Floats:
        """The probability of each cell, for reading only: float64, shape (N, N)."""
        return self._only if self._only is not None else over_hypotheses(self.belief)

    def probabilities(self, searched: Collection[int]) -> list[float]:
        """The belief about some cells, over all hypotheses."""
        cells = self._cells
        totals = [cells[cell] for cell in searched]
        if self._only is None:
            for offset in self._offsets[1:]:
                totals = [*map(add, totals, [cells[cell + offset] for cell in searched])]
        return totals


class Posteriors:
    """The beliefs about all persons of a search; the arithmetic is that of `belief`.

    Every person's belief is that of a person who has not been found, even after the find.

    Args:
        forecasts: of each person.
        detections: each person's probability of detection.
    """

    def __init__(self, forecasts: Sequence[ProbabilityMatrix], detections: Sequence[float]) -> None:
        self._posteriors = [*map(_Posterior, forecasts, detections)]

    def start(self, step: int) -> None:
        """Begin an episode's beliefs: set them to the forecasts at a step."""
        for posterior in self._posteriors:
            posterior.start(step)

    def search(self, searched: Collection[int]) -> None:
        """Apply the searches of a step.

        Args:
            searched: the searched cells, y * N + x, each once.
        """
        for posterior in self._posteriors:
            posterior.search(searched)

    def drift(self, step: int) -> None:
        """Let all beliefs drift from a step to the next."""
        for posterior in self._posteriors:
            posterior.drift(step)

    def probability_of_success(self) -> float:
        """The cumulative probability of success (POS): the mean over all persons."""
        if len(self._posteriors) == 1:
            return 1.0 - self._posteriors[0].kept
        return 1.0 - mean_over_missing([each.kept for each in self._posteriors], ())

    def weights(self) -> tuple[tuple[float, ...], ...]:
        """The probability of each hypothesis about each person."""
        return tuple(tuple(each.belief.sum(axis=(1, 2)).tolist()) for each in self._posteriors)

    def matrix(self, missing: Collection[int]) -> NDArray[np.float32]:
        """The matrix that the drones observe: float32, shape (N, N), indexed [y, x]; a new array.

        Args:
            missing: see `mean_over_missing`.
        """
        beliefs = [each.over_hypotheses() for each in self._posteriors]
        return mean_over_missing(beliefs, missing).astype(np.float32)

    def probabilities(self, searched: Collection[int], missing: Collection[int]) -> list[float]:
        """What `matrix` holds for some cells, y * N + x."""
        first, *others = self._posteriors
        means = first.probabilities(searched)
        if others:
            by_person = means, *(each.probabilities(searched) for each in others)
            means = [mean_over_missing(cell, missing) for cell in zip(*by_person, strict=True)]
        return array("f", means).tolist()  # rounded to single precision

    def added_success(self, searched: Collection[int]) -> list[float]:
        """The probability of success that a search of each of some cells adds, before `search`."""
        by_person = []
        for each in self._posteriors:
            factor = each.kept * each.detection
            by_person.append([factor * chance for chance in each.probabilities(searched)])
        return [mean_over_missing(cell, ()) for cell in zip(*by_person, strict=True)]
