"""What an evaluation brings: the episodes, the figures that follow, and their files."""

from __future__ import annotations

import csv
import io
import json
import math
from collections.abc import Iterable, Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from pathlib import Path
from typing import Any, Protocol

import numpy as np
from numpy.typing import NDArray

import DroneSwarmSearch
from DroneSwarmSearch._internal import checks
from DroneSwarmSearch.evaluation import statistics
from DroneSwarmSearch.evaluation.files import write_text
from DroneSwarmSearch.evaluation.statistics import Band, Estimate, Reliability
from DroneSwarmSearch.evaluation.suite import SUITE_VERSION, NamedSearch
from DroneSwarmSearch.rules import Ending

__all__ = [
    "Bound",
    "Comparison",
    "Episodes",
    "Evaluation",
    "checked_bound",
    "compare",
    "save_csv",
    "save_episodes",
    "save_json",
]

Floats = NDArray[np.float64]
Ints = NDArray[np.int64]


class Bound(Protocol):
    """What is needed of `planning.SuccessBound`."""

    @property
    def by_time(self) -> Floats:
        """The most that any policy can reach within t steps: float64, (L + 1,)."""

    @property
    def gap(self) -> float:
        """The duality gap at L, which `by_time` contains."""

    @property
    def confidence(self) -> float:
        """That the bound holds; 1.0 where it is exact."""


def checked_bound(bound: object, search: NamedSearch) -> Any:
    """A bound of a search, or None.

    Raises:
        TypeError: it is no bound.
        ValueError: it is that of another search.
    """
    if bound is None:
        return None
    by_time = getattr(bound, "by_time", None)
    figures = [getattr(bound, name, None) for name in ("gap", "confidence")]
    if not isinstance(by_time, np.ndarray) or not all(map(checks.is_number, figures)):
        raise TypeError(
            f"bound must be what planning.success_bound returns, or None, got {bound!r}"
        )
    steps = search.scenario.timestep_limit
    if by_time.shape != (steps + 1,):
        raise ValueError(
            f"bound must be that of {search.name}, with a by_time of shape ({steps + 1},), "
            f"got {by_time.shape}"
        )
    return bound


@dataclass(frozen=True, eq=False)
class Episodes:
    """What happened in some episodes, in the order of their seeds.

    Attributes:
        found_at: the number of the step in which each person was found, 0 for never:
            int64, shape (n, persons). A find in the first step is at 1.
        endings: why each episode ended, each an `Ending`, or 0: int64, (n,).
        steps: the steps each lasted: int64, (n,).
        returns: the sum of all drones' rewards: float64, (n,).
        reliability: of the chances that the matrix shown gave the searches made.
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
        """Several portions as one, in their order."""
        return cls(
            np.concatenate([part.found_at for part in parts]),
            np.concatenate([part.endings for part in parts]),
            np.concatenate([part.steps for part in parts]),
            np.concatenate([part.returns for part in parts]),
            Reliability.total([part.reliability for part in parts]),
        )

    @property
    def data(self) -> dict[str, Any]:
        """The same as plain data, which JSON keeps to the last bit."""
        return {
            "found_at": self.found_at.tolist(),
            "endings": self.endings.tolist(),
            "steps": self.steps.tolist(),
            "returns": self.returns.tolist(),
            "searches": self.reliability.searches.tolist(),
            "promised": self.reliability.promised.tolist(),
            "found": self.reliability.found.tolist(),
        }

    @classmethod
    def from_data(cls, data: Any) -> Episodes:
        """Episodes from their `data`.

        Raises:
            ValueError: it is no such data, or contradicts itself.
        """
        try:
            found_at = np.array(data["found_at"])
            endings, steps = np.array(data["endings"]), np.array(data["steps"])
            returns = np.array(data["returns"], np.float64)
            searches, found = np.array(data["searches"]), np.array(data["found"])
            promised = np.array(data["promised"], np.float64)
        except (KeyError, OverflowError, TypeError, ValueError) as error:
            raise ValueError(f"data must be that of episodes: {error!r}") from error
        n, bins = endings.size, (len(statistics.CHANCE_EDGES) - 1,)
        counts, sums = (found_at, endings, steps, searches, found), (returns, promised)
        if not (
            all(array.dtype.kind == "i" and (array >= 0).all() for array in counts)
            and all(np.isfinite(array).all() for array in sums)
            and found_at.ndim == 2
            and found_at.shape[0] == n > 0
            and endings.shape == steps.shape == returns.shape == (n,)
            and searches.shape == found.shape == promised.shape == bins
            and endings.min() >= 1
            and endings.max() < len(Ending) + 1
            and (found_at <= steps[:, None]).all()
        ):
            raise ValueError("data must be that of episodes: its figures contradict each other")
        return cls(found_at, endings, steps, returns, Reliability(searches, promised, found))


@dataclass(frozen=True, eq=False)
class Evaluation:
    """A policy evaluated on a search: the episodes, and what follows from them.

    An episode succeeds when every person is found by the limit.

    Attributes:
        policy: its name.
        search: the search, with `bayesian_update` as it was evaluated.
        seed: of the first episode; episode i has the seed `seed + i`.
        view: how the searches were shown: "swarm", "drone" or "parallel".
        observation: in which layout, a name of `layouts.LAYOUTS`.
        episodes: what happened.
        bound: what no policy can exceed on this search, if it was worked out.
    """

    policy: str
    search: NamedSearch
    seed: int
    view: str
    observation: str
    episodes: Episodes
    bound: Bound | None = None

    def __repr__(self) -> str:
        value, low, high = self.success.scaled(100.0)
        return (
            f"<Evaluation of {self.policy} on {self.search.name}: {len(self.episodes):,} episodes, "
            f"{value:.1f} % found ({low:.1f} to {high:.1f})>"
        )

    def with_bound(self, bound: Bound | None) -> Evaluation:
        """The same with the bound that belongs to the search.

        Raises:
            TypeError: it is no bound.
            ValueError: it is that of another search.
        """
        return replace(self, bound=checked_bound(bound, self.search))

    @property
    def limit(self) -> int:
        """The steps of an episode, L."""
        return self.search.scenario.timestep_limit

    @cached_property
    def found_by(self) -> Ints:
        """The step by which everybody was found, 0 where not all were: int64, (n,)."""
        found_at = self.episodes.found_at
        everybody = (found_at > 0).all(axis=1)
        return np.where(everybody, found_at.max(axis=1), 0)

    @cached_property
    def times(self) -> Floats:
        """The step by which everybody was found, L where not all were: float64, (n,)."""
        return statistics.restricted_times(self.found_by, self.limit)

    @cached_property
    def success_by_time(self) -> Band:
        """The share of successes within t steps, t = 0..L, with Wilson's interval: (L + 1,)."""
        return statistics.share_by_time(self.found_by, self.limit)

    @property
    def success(self) -> Estimate:
        """The share of successes by the limit, with Wilson's interval."""
        return self.success_by_time.at(-1)

    @cached_property
    def time(self) -> Estimate:
        """The restricted mean time to find, in steps, with its bootstrap interval."""
        return statistics.bootstrap_mean(self.times)

    @cached_property
    def mean_return(self) -> Estimate:
        """The mean of the team's return, with its bootstrap interval."""
        return statistics.bootstrap_mean(self.episodes.returns)

    @property
    def share_of_bound(self) -> Estimate | None:
        """The success as a share of the bound; None without a bound above 0."""
        if self.bound is None or not self.bound.by_time[-1] > 0.0:
            return None
        return self.success.scaled(1.0 / float(self.bound.by_time[-1]))

    @property
    def reliability(self) -> Reliability:
        """The calibration of the matrix shown."""
        return self.episodes.reliability

    @property
    def endings(self) -> dict[Ending, int]:
        """How many episodes ended for each reason."""
        counts = np.bincount(self.episodes.endings, minlength=len(Ending) + 1).tolist()
        return {ending: counts[ending] for ending in Ending}

    @property
    def data(self) -> dict[str, Any]:
        """All that is known but the single episodes, as plain data for JSON."""
        reliability, by_time, bound = self.reliability, self.success_by_time, self.bound
        return {
            "package": DroneSwarmSearch.__version__,
            "numpy": np.__version__,
            "suite": SUITE_VERSION,
            "policy": self.policy,
            "search": self.search.name,
            "parameters": self.search.data,
            "view": self.view,
            "observation": self.observation,
            "episodes": len(self.episodes),
            "seed": self.seed,
            "confidence": statistics.CONFIDENCE,
            "success": _figure(self.success),
            "restricted_mean_time": _figure(self.time),
            "mean_return": _figure(self.mean_return),
            "share_of_bound": _figure(self.share_of_bound),
            "endings": {ending.name.lower(): count for ending, count in self.endings.items()},
            "success_by_time": {name: curve.tolist() for name, curve in by_time._asdict().items()},
            "bound": bound
            and {
                "by_time": bound.by_time.tolist(),
                "gap": float(bound.gap),
                "confidence": float(bound.confidence),
            },
            "calibration": {
                "from": list(statistics.CHANCE_EDGES[:-1]),
                "searches": reliability.searches.tolist(),
                "mean_promised": _numbers(reliability.mean_promised),
                "share_found": _numbers(reliability.share_found),
                "expected_error": reliability.expected_error,
            },
        }

    @property
    def summary(self) -> dict[str, Any]:
        """The main figures in one row, for tables."""
        row: dict[str, Any] = {
            "package": DroneSwarmSearch.__version__,
            "suite": SUITE_VERSION,
            "policy": self.policy,
            "search": self.search.name,
            "bayesian_update": self.search.scenario.bayesian_update,
            "episodes": len(self.episodes),
            "seed": self.seed,
            "timestep_limit": self.limit,
        }
        for name, figure in (
            ("success", self.success),
            ("restricted_mean_time", self.time),
            ("mean_return", self.mean_return),
            ("share_of_bound", self.share_of_bound),
        ):
            value, low, high = figure or ("", "", "")
            row |= {name: value, f"{name}_low": low, f"{name}_high": high}
        row["bound"] = "" if self.bound is None else float(self.bound.by_time[-1])
        row |= {ending.name.lower(): count for ending, count in self.endings.items()}
        row["calibration_error"] = self.reliability.expected_error
        return row


@dataclass(frozen=True)
class Comparison:
    """Two policies on the same seas: differences episode by episode, first less second.

    Attributes:
        policies: their names.
        search: the search's name.
        success: the difference in the share of successes; above 0 the first is better.
        time: the difference in the restricted mean time to find, in steps; below 0 the
            first is faster.
    """

    policies: tuple[str, str]
    search: str
    success: Estimate
    time: Estimate


def compare(first: Evaluation, second: Evaluation) -> Comparison:
    """Compare two policies in the same episodes, with paired bootstrap intervals.

    Episodes are resampled, each with what both policies made of it: since the seas are the
    same, much of the chance cancels out. What the drones were shown, the drift alone or the
    posterior, may differ.

    Raises:
        ValueError: the evaluations are not of the same episodes of one search.
    """
    one, other = (each.search.with_posterior(False) for each in (first, second))
    if one.fingerprint != other.fingerprint:
        raise ValueError(
            "second must be of the same search as first, with the same parameters, got "
            f"{second.search.name!r} beside {first.search.name!r}"
        )
    mine, theirs = ((each.seed, len(each.episodes)) for each in (first, second))
    if mine != theirs:
        raise ValueError(
            f"second must be of the same episodes as first, {mine[1]} from seed {mine[0]}, "
            f"got {theirs[1]} from seed {theirs[0]}"
        )
    found, found_too = first.found_by > 0, second.found_by > 0
    return Comparison(
        (first.policy, second.policy),
        first.search.name,
        statistics.bootstrap_mean(found.astype(np.float64) - found_too),
        statistics.bootstrap_mean(first.times - second.times),
    )


# Files. All are written beside their place first, so that none is ever half there.


def save_json(path: str | Path, evaluations: Evaluation | Iterable[Evaluation]) -> None:
    """Write one evaluation, or a list of several, as JSON (`Evaluation.data`).

    Raises:
        StorageError: the file cannot be written, because the disk is full for example.
    """
    several = not isinstance(evaluations, Evaluation)
    data = [each.data for each in evaluations] if several else evaluations.data  # type: ignore[union-attr]
    write_text(Path(path), json.dumps(data, indent=1, allow_nan=False) + "\n")


def save_csv(path: str | Path, evaluations: Iterable[Evaluation]) -> None:
    """Write the main figures as CSV, a row for each evaluation (`Evaluation.summary`).

    Raises:
        StorageError: the file cannot be written.
        ValueError: there is no evaluation.
    """
    write_text(Path(path), csv_text(evaluations))


def csv_text(evaluations: Iterable[Evaluation]) -> str:
    """What `save_csv` writes."""
    rows = [each.summary for each in evaluations]
    if not rows:
        raise ValueError("evaluations must be at least one, got none")
    return _csv(list(rows[0]), [list(row.values()) for row in rows])


def save_episodes(path: str | Path, evaluation: Evaluation) -> None:
    """Write the single episodes as CSV: seed, success, ending, steps, return, finds.

    Raises:
        StorageError: the file cannot be written.
    """
    episodes = evaluation.episodes
    persons = range(episodes.found_at.shape[1])
    names = ["seed", "success", "ending", "steps", "return", "found_by"]
    rows = zip(
        range(evaluation.seed, evaluation.seed + len(episodes)),
        (evaluation.found_by > 0).astype(int).tolist(),
        (Ending(ending).name.lower() for ending in episodes.endings.tolist()),
        episodes.steps.tolist(),
        episodes.returns.tolist(),
        evaluation.found_by.tolist(),
        episodes.found_at.tolist(),
        strict=True,
    )
    text = _csv(
        [*names, *(f"person{i}_found_at" for i in persons)], [[*row[:-1], *row[-1]] for row in rows]
    )
    write_text(Path(path), text)


def _csv(names: Sequence[str], rows: Iterable[Sequence[Any]]) -> str:
    out = io.StringIO()
    writer = csv.writer(out, lineterminator="\n")
    writer.writerow(names)
    writer.writerows(rows)
    return out.getvalue()


def _figure(estimate: Estimate | None) -> dict[str, float] | None:
    return None if estimate is None else estimate._asdict()


def _numbers(values: Floats) -> list[float | None]:
    """Numbers for JSON, which has no NaN."""
    return [None if math.isnan(value) else value for value in values.tolist()]
