"""The success of sampled episodes without the chance of the last find: conditional Monte Carlo.

Each episode is played as an ordinary one, except that no search finds the last missing person.
Given the path that the drones then fly, the probability that the person is found within t steps
is one minus the product, over these steps, of the probability that the step's searches do not
find the person (`drift.belief`). Until that find, the drones only learn that the person was not
found, so the mean of these probabilities estimates the success without bias: the law of total
expectation. Its variance is never above that of the share of episodes that succeed.

R. Y. Rubinstein and D. P. Kroese, Simulation and the Monte Carlo Method, 3rd edition, 2016,
section 5.4.
"""

from __future__ import annotations

import base64
import zlib
from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from DroneSwarmSearch.evaluation.episodes import is_curve
from DroneSwarmSearch.evaluation.rollout import PolicyLike, Stage, reset_policy, stage_of
from DroneSwarmSearch.evaluation.suite import NamedSearch
from DroneSwarmSearch.evaluation.workers import Report
from DroneSwarmSearch.rules import Action, RewardScheme
from DroneSwarmSearch.vector.engine import SearchBatch

__all__ = ["as_text", "conditional_success", "from_text"]

Floats = NDArray[np.float64]


def conditional_success(
    policy: PolicyLike,
    search: NamedSearch,
    seeds: Sequence[int],
    view: str = "swarm",
    observation: str = "dict",
    report: Report = lambda share: None,
    masks: bool | None = None,
) -> Floats:
    """The probability that every person is found within t steps, given an episode's path.

    Args:
        policy: a callable from observations to actions. Its method `reset`, if it has one,
            receives the seeds before the episodes begin.
        search: a rescue.
        seeds: of the episodes, integers >= 0.
        view: what the policy sees and returns, see `evaluate`; validated.
        observation: the layout of its observations.
        report: called with the share of the work done.
        masks: whether the masks that it gets have right of way; None for no masks.

    Returns:
        float64, shape (n, L + 1): for each episode and t = 0..L. With several persons, it is 0
        until all but one are found.

    Raises:
        TypeError: the policy returns a wrong type.
        ValueError: the policy returns actions out of range or of a wrong shape.
    """
    # These rewards need the beliefs; the policy does not see them.
    scenario = search.scenario.replace(reward_scheme=RewardScheme.expected())
    at_once = 1 if view == "parallel" else len(seeds)
    batch = SearchBatch(
        at_once, scenario=scenario, drones_positions=search.drones, finds_last=False
    )
    stage, curves = stage_of(batch, view, observation, masks), []
    for first in range(0, len(seeds), at_once):
        some = seeds[first : first + at_once]
        reset_policy(policy, stage.seeds(some))
        batch.reset(some)

        def report_step(share: float, done: int = first) -> None:
            report((done + share * at_once) / len(seeds))

        curves.append(_curves(policy, batch, stage, report_step))
    return np.concatenate(curves)


def _curves(policy: PolicyLike, batch: SearchBatch, stage: Stage, report: Report) -> Floats:
    """Play the episodes of a batch together: float64, (rows, L + 1)."""
    limit, rows = batch.scenario.timestep_limit, np.arange(batch.num_rows)
    success = np.zeros((len(rows), limit + 1))
    before = np.ones(len(rows))  # the last person's probability of failure, before being the last
    was_last = batch.missing.sum(axis=1) == 1
    for step in range(1, limit + 1):
        actions = np.full(batch.cells.shape, int(Action.IDLE))
        actions[rows] = stage.actions(policy, rows)
        batch.step(actions)

        missing, failure = batch.missing[rows], batch.probability_of_failure
        assert failure is not None
        count, now = missing.sum(axis=1), failure[rows, missing.argmax(axis=1)]
        is_last = count == 1
        new = is_last & ~was_last[rows]
        before[rows[new]] = now[new]
        was_last[rows] = is_last
        missed = np.ones(len(rows))
        np.divide(now, before[rows], out=missed, where=is_last & (before[rows] > 0.0))
        success[rows, step] = np.where(count == 0, 1.0, 1.0 - missed)

        goes_on = (batch.endings[rows] == 0) & (success[rows, step] < 1.0)
        rows = rows[goes_on]
        report(step / limit if rows.size else 1.0)
        if not rows.size:
            break
    # The probability never falls, so the last one is carried beyond the end of an episode.
    return np.maximum.accumulate(success, axis=1)


# The store. Decimal numbers would take five times the space: most values repeat the one before.


def as_text(curves: Floats) -> str:
    """Curves as text, which keeps them exactly."""
    packed = zlib.compress(np.ascontiguousarray(curves, "<f8").tobytes())
    return base64.b64encode(packed).decode("ascii")


def from_text(text: object, shape: tuple[int, int]) -> Floats:
    """Curves from their text.

    Args:
        text: what `as_text` returned.
        shape: their shape (n, L + 1).

    Raises:
        ValueError: it is another text, or the curves are inconsistent.
    """
    if not isinstance(text, str):
        raise ValueError(f"text must be a string, got {text!r:.200}")
    try:
        packed = base64.b64decode(text, validate=True)
        curves = np.frombuffer(zlib.decompress(packed), "<f8").reshape(shape).astype(np.float64)
    except zlib.error as error:
        raise ValueError(f"text must be compressed curves: {error}") from error
    if not is_curve(curves):
        raise ValueError("text must be that of probabilities that never fall")
    return curves
