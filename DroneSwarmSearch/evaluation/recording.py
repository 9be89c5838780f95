"""Play one episode, and record it as a video."""

from __future__ import annotations

import base64
import os
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

from DroneSwarmSearch._internal import checks
from DroneSwarmSearch._internal.progress import Progress
from DroneSwarmSearch.env import DroneSwarmSearch
from DroneSwarmSearch.evaluation.policy_spec import PolicySpec
from DroneSwarmSearch.evaluation.rollout import reset_policy
from DroneSwarmSearch.evaluation.suite import NamedSearch, as_named
from DroneSwarmSearch.frame import Frame
from DroneSwarmSearch.rendering.palette import Look
from DroneSwarmSearch.rendering.video import FPS_LEAST, FPS_MOST, write_video

HOLD = 3.0  # seconds for which the last picture stays
GIF_WIDTH = 1000  # pixels at most


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
    fps: float = 6.0,
    title: str | None = None,
    both: bool = False,
) -> Video:
    """Record a video of one episode: what the searches so far leave of the probability.

    The map is cropped to the likely cells, the drones and the persons. An existing file is only
    replaced when the video is complete.

    Args:
        policy: as for `evaluate`; a callable sees one search, as `DroneSwarmSearch` shows it.
        search: the name of a search of the suite, a `NamedSearch`, or a `Scenario`.
        path: the file, .gif or .mp4.
        seed: of the episode, an integer >= 0.
        name: the policy's name in the picture.
        bayesian_update: whether the policy sees the posterior; None: as in the search.
        fps: steps shown per second, from 0.1 to 50.
        title: up to two lines above the map; None: the first sentence of the search's `reason`.
        both: show the whole maps of prior and posterior side by side, with a panel instead.

    Raises:
        ImportError: the package of the extra "video" is missing.
        OSError: the file cannot be written.
        TypeError, ValueError: an argument is invalid.
    """
    from DroneSwarmSearch.rendering.film import Film
    from DroneSwarmSearch.rendering.painter import Painter

    target, rate = Path(path), checks.real("fps", fps, FPS_LEAST, FPS_MOST)
    spec, where = PolicySpec.of(policy, name), as_named(search).with_posterior(bayesian_update)
    first = checks.integer("seed", seed, 0)
    made = spec.make(where.scenario)
    label = f"{spec.name} searching {where.name}, seed {seed}"
    last: list[Frame] = []

    def frames() -> Iterator[Frame]:
        for frame, _ in play(made, where, first):
            last[:] = [frame]
            bar(frame.step)
            yield replace(frame, policy=label if both else spec.name, scale=where.scale)

    def painter_of(played: Sequence[Frame]) -> Film | Painter:
        if both:
            reason = where.reason if where.scale else ""
            return Painter(where.scenario.grid_size, Look(grid=True), view="both", reason=reason)
        return Film(played, title=where.reason if title is None else title)

    with Progress(f"video of {label}", where.scenario.timestep_limit) as bar:
        write_video(target, frames(), painter_of, fps=rate, hold=HOLD, gif_width=GIF_WIDTH)
    return Video(target, last[0])


def play(
    policy: Callable[..., Any], search: NamedSearch, seed: int
) -> Iterator[tuple[Frame, tuple[int, ...]]]:
    """Play one episode in two environments, which show the prior and the posterior.

    Of every step, from `reset` on, yields a frame with both and the return under the one that the
    policy observes, by the search's `bayesian_update`; and the drones' actions.
    """
    envs = [
        DroneSwarmSearch(scenario=search.scenario.replace(bayesian_update=flag), render_mode=None)
        for flag in (False, True)
    ]
    shown = search.scenario.bayesian_update
    observations = [env.reset(seed, drones_positions=search.drones)[0] for env in envs]
    reset_policy(policy, seed)
    chosen: tuple[int, ...] = ()
    while True:
        prior, posterior = (env.frame() for env in envs)
        total = (prior, posterior)[shown].total_return
        yield replace(posterior, prior=prior.matrix, total_return=total), chosen
        if not envs[0].agents:
            return
        actions = policy(observations[shown])
        chosen = tuple(int(actions[drone]) for drone in envs[0].possible_agents)
        observations = [env.step(actions)[0] for env in envs]
