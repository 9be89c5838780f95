"""What happened in evaluated episodes."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from DroneSwarmSearch.evaluation.calibration import POS_EDGES, Reliability
from DroneSwarmSearch.rules import Ending

__all__ = ["Episodes"]

Floats = NDArray[np.float64]
Ints = NDArray[np.int64]


@dataclass(frozen=True, eq=False)
class Episodes:
    """What happened in some episodes, in the order of their seeds.

    Attributes:
        found_at: the step in which each person was found, from 1, or 0 for never: int64,
            (n, persons).
        endings: the `Ending` of each episode: int64, (n,).
        steps: the number of steps: int64, (n,).
        returns: the sum of all drones' rewards: float64, (n,).
        reliability: of the forecasts of all searches made.
    """

    found_at: Ints
    endings: Ints
    steps: Ints
    returns: Floats
    reliability: Reliability

    def __len__(self) -> int:
        return len(self.endings)

    @classmethod
    def joined(cls, parts: Sequence[Episodes]) -> Episodes:
        """Join several portions, in their order."""
        return cls(
            np.concatenate([part.found_at for part in parts]),
            np.concatenate([part.endings for part in parts]),
            np.concatenate([part.steps for part in parts]),
            np.concatenate([part.returns for part in parts]),
            Reliability.total([part.reliability for part in parts]),
        )

    @property
    def data(self) -> dict[str, Any]:
        """Plain data, which JSON keeps exactly."""
        return {
            "found_at": self.found_at.tolist(),
            "endings": self.endings.tolist(),
            "steps": self.steps.tolist(),
            "returns": self.returns.tolist(),
            "searches": self.reliability.searches.tolist(),
            "forecast": self.reliability.forecast.tolist(),
            "found": self.reliability.found.tolist(),
        }

    @classmethod
    def from_data(cls, data: Any) -> Episodes:
        """Make episodes from their `data`.

        Raises:
            ValueError: the data are of another form, or inconsistent.
        """
        try:
            found_at = np.array(data["found_at"])
            endings, steps = np.array(data["endings"]), np.array(data["steps"])
            returns = np.array(data["returns"], np.float64)
            searches, found = np.array(data["searches"]), np.array(data["found"])
            forecast = np.array(data["forecast"], np.float64)
        except (KeyError, OverflowError, TypeError, ValueError) as error:
            raise ValueError(f"data must be that of episodes: {error!r}") from error
        n, bins = endings.size, (len(POS_EDGES) - 1,)
        counts, sums = (found_at, endings, steps, searches, found), (returns, forecast)
        if not (
            all(array.dtype.kind == "i" and (array >= 0).all() for array in counts)
            and all(np.isfinite(array).all() for array in sums)
            and found_at.ndim == 2
            and found_at.shape[0] == n > 0
            and endings.shape == steps.shape == returns.shape == (n,)
            and searches.shape == found.shape == forecast.shape == bins
            and endings.min() >= 1
            and endings.max() <= len(Ending)
            and (found_at <= steps[:, None]).all()
        ):
            raise ValueError("data must be that of episodes, but it is inconsistent")
        return cls(found_at, endings, steps, returns, Reliability(searches, forecast, found))
