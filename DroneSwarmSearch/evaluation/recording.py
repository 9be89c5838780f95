"""Record a video of one episode: the prior on the left, the posterior on the right.

Two environments with the same seed and the same actions run through the same episode. One shows
the prior, the other the posterior, so both halves of a picture show the same drones and persons.
"""

from __future__ import annotations

import base64
import os
from collections.abc import Callable, Iterator
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any, NamedTuple

from DroneSwarmSearch._internal import checks
from DroneSwarmSearch._internal.files import check_writable
from DroneSwarmSearch._internal.progress import Progress
from DroneSwarmSearch.env import DroneSwarmSearch
from DroneSwarmSearch.evaluation.policy_spec import PolicySpec
from DroneSwarmSearch.evaluation.rollout import reset_policy
from DroneSwarmSearch.evaluation.suite import NamedSearch, as_named
from DroneSwarmSearch.rendering.frame import Frame
from DroneSwarmSearch.rendering.video import SUFFIXES, pictures_per_step, write_video

__all__ = ["FPS", "Moment", "Video", "frames", "moments", "record"]

FPS = 6.0
"""Steps shown per second."""

FPS_LEAST, FPS_MOST = 0.1, 50.0
"""The range of `fps`; a GIF cannot be faster."""

HOLD = 3.0
"""Seconds for which the last picture stays."""

GIF_WIDTH = 1000
"""The largest width in pixels."""


@dataclass(frozen=True)
class Video:
    """A video of one episode, which notebooks show.

    Attributes:
        path: the file.
        last: the last frame of the episode, with the posterior as its matrix.
    """

    path: Path
    last: Frame

    def _repr_html_(self) -> str:
        """The video inside the page, so that a saved notebook still has it."""
        data = base64.b64encode(self.path.read_bytes()).decode()
        if self.path.suffix.lower() == ".gif":
            return f'<img src="data:image/gif;base64,{data}" style="max-width: 100%">'
        return (
            '<video controls loop autoplay muted style="max-width: 100%" '
            f'src="data:video/mp4;base64,{data}"></video>'
        )


def record(
    policy: object,
    search: object,
    path: str | os.PathLike[str],
    *,
    seed: int = 0,
    name: str | None = None,
    bayesian_update: bool | None = None,
    fps: float = FPS,
) -> Video:
    """Record a video of one episode: the prior on the left, the posterior on the right.

    An existing file is only replaced when the video is complete.

    Args:
        policy: as for `evaluate`; a callable sees one search, as `DroneSwarmSearch` shows it.
        search: the name of a search of the suite, a `NamedSearch`, or a `Scenario`.
        path: the file, .gif or .mp4.
        seed: of the episode, an integer >= 0.
        name: the policy's name in the picture.
        bayesian_update: whether the policy sees the posterior or the prior; None: as in
            the search.
        fps: steps shown per second, from 0.1 to 50.

    Returns:
        The video. A notebook shows it if it is the last expression of a cell.

    Raises:
        ImportError: a package of the extra "video" is missing, or its ffmpeg.
        OSError: the file cannot be written.
        TypeError: an argument is of the wrong type.
        ValueError: an argument is out of range, or a name is unknown.
    """
    from DroneSwarmSearch.rendering.painter import Painter

    if not isinstance(path, (str, os.PathLike)):
        raise TypeError(f"path must be the path of a file, got {path!r}")
    target = Path(path)
    if target.suffix.lower() not in SUFFIXES:
        raise ValueError(f"path must end in {' or '.join(SUFFIXES)}, got {str(path)!r}")
    rate = checks.real("fps", fps, FPS_LEAST, FPS_MOST)
    spec, where = PolicySpec.of(policy, name), as_named(search)
    pairs = frames(spec, where, seed=seed, bayesian_update=bayesian_update)
    check_writable(target)
    title = f"{spec.name} searching {where.name}, seed {seed}"
    painter = Painter(where.scenario.grid_size, render_grid=True, view="both")
    last: list[Frame] = []

    def titled() -> Iterator[Frame]:
        for prior, posterior in pairs:
            last[:] = [posterior]
            bar(posterior.step)
            yield replace(posterior, prior=prior.matrix, policy=title)

    per_step = pictures_per_step(rate)
    with Progress(f"video of {title}", where.scenario.timestep_limit) as bar:
        pictures = painter.video(titled(), per_step)
        write_video(target, pictures, fps=rate * per_step, hold=HOLD, gif_width=GIF_WIDTH)
    return Video(target, last[0])


def frames(
    policy: object,
    search: object,
    *,
    seed: int = 0,
    bayesian_update: bool | None = None,
) -> Iterator[tuple[Frame, Frame]]:
    """Play one episode in two environments, with the prior and with the posterior.

    The arguments are those of `record`.

    Returns:
        An iterator over the steps, from the state after `reset`: the frame with the prior as
        its matrix, and the frame with the posterior.

    Raises:
        TypeError: an argument is of the wrong type.
        ValueError: an argument is out of range, or a name is unknown.
    """
    where = as_named(search)
    scenario = where.scenario
    first = checks.integer("seed", seed, 0)
    if bayesian_update is None:
        bayesian_update = scenario.bayesian_update
    else:
        bayesian_update = checks.boolean("bayesian_update", bayesian_update)
    made = PolicySpec.of(policy).make(scenario)
    played = moments(made, where, first, bayesian_update)
    return ((moment.prior, moment.posterior) for moment in played)


class Moment(NamedTuple):
    """One moment of an episode.

    Attributes:
        prior: the frame with the prior as its matrix.
        posterior: the frame with the posterior as its matrix.
        actions: each drone's last action; empty after `reset`.
    """

    prior: Frame
    posterior: Frame
    actions: tuple[int, ...]


def moments(
    policy: Callable[..., Any], search: NamedSearch, seed: int, bayesian_update: bool
) -> Iterator[Moment]:
    """Play one episode in two environments; the arguments are those of `record`, validated.

    Returns:
        An iterator over the steps, from the state after `reset`. Returns are those of the
        environment that the policy observes.
    """
    scenarios = [search.scenario.replace(bayesian_update=flag) for flag in (False, True)]
    prior, posterior = envs = [
        DroneSwarmSearch(scenario=each, render_mode=None) for each in scenarios
    ]
    shown = [env.reset(seed, drones_positions=search.drones)[0] for env in envs]
    reset_policy(policy, seed)

    def moment(actions: tuple[int, ...]) -> Moment:
        pair = prior.frame(), posterior.frame()
        earned = pair[bayesian_update].total_return
        before, after = (replace(frame, total_return=earned) for frame in pair)
        return Moment(before, after, actions)

    yield moment(())
    while prior.agents:
        actions = policy(shown[bayesian_update])
        results = [env.step(actions) for env in envs]
        chosen = tuple(int(actions[drone]) for drone in prior.get_agents())
        shown = [result[0] for result in results]
        yield moment(chosen)
