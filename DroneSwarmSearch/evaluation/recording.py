"""Play one episode, and record it as a video."""

from __future__ import annotations

import base64
import os
from collections.abc import Iterator
from dataclasses import dataclass, replace
from pathlib import Path

from DroneSwarmSearch._internal import checks
from DroneSwarmSearch._internal.files import try_folder
from DroneSwarmSearch._internal.progress import progress
from DroneSwarmSearch.core.frame import Frame
from DroneSwarmSearch.core.named_search import NamedSearch
from DroneSwarmSearch.env import DroneSwarmSearch
from DroneSwarmSearch.evaluation.policy_spec import PolicySpec
from DroneSwarmSearch.evaluation.stage import PolicyLike, prepared, steering, view_of
from DroneSwarmSearch.evaluation.suite import as_named
from DroneSwarmSearch.layouts.view import View
from DroneSwarmSearch.rendering.palette import PALETTES, Look
from DroneSwarmSearch.rendering.video import FPS_LEAST, FPS_MOST, SUFFIXES, write_video

HOLD = 3.0  # seconds for which the last picture stays


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
    view: View | str | None = None,
    fps: float = 6.0,
    title: str | None = None,
    palette: str = "sea",
    drone: int | None = None,
) -> Video:
    """Record a video of one episode: what the searches so far leave of the probability.

    The map is cropped to the likely cells, the drones and the persons. An existing file is only
    replaced when the video is complete.

    Args:
        policy: as for `evaluate`.
        search: the name of a search of the suite, a `NamedSearch`, or a `Scenario`.
        path: the file, .gif or .mp4.
        seed: of the episode, an integer >= 0.
        name: the policy's name in the picture.
        view: what the policy sees, as for `evaluate`.
        fps: steps shown per second, from 0.1 to 50.
        title: the story, in two lines; None: the beginning of the search's `reason`.
        palette: the colours of the map, "sea" or "classic".
        drone: the number of the drone whose map is shown; None for that of all drones together.

    Raises:
        ImportError: the package of the extra "video" is missing.
        OSError: the file cannot be written.
        TypeError, ValueError: an argument is invalid.
    """
    target = checks.suffix("path", path, SUFFIXES)
    rate = checks.real("fps", fps, FPS_LEAST, FPS_MOST)
    checks.choice("palette", palette, tuple(PALETTES))
    spec = PolicySpec.of(policy, name)
    where = as_named(search)
    first = checks.integer("seed", seed, 0)
    if drone is not None:
        drone = checks.integer("drone", drone, 0, where.scenario.n_drones - 1)
        if where.scenario.radio_range is None:
            raise ValueError(f"drone needs a search with a radio_range, got drone={drone}")
    seen = view_of(spec, where, view)
    where = where.with_posterior(seen.bayesian_update)
    try_folder(target.parent)
    made = prepared(spec, where)
    last = None

    def frames() -> Iterator[Frame]:
        nonlocal last
        for frame, _ in play(made, where, first, seen):
            last = replace(
                frame.seen_by(drone), policy=spec.name, scale=where.scale, land=where.land
            )
            bar(frame.step)
            yield last

    story = where.reason if title is None else title
    with progress(f"video of {spec.name}", where.scenario.timestep_limit) as bar:
        write_video(target, frames(), Look(palette=palette), title=story, fps=rate, hold=HOLD)
    assert last is not None
    return Video(target, last)


def frames_by_drone(env: DroneSwarmSearch) -> tuple[Frame, ...]:
    """The current frame with each drone's map; empty if all drones have the same."""
    if env.scenario.radio_range is None:
        return ()
    return tuple(env.frame(drone) for drone in range(env.n_drones))


def play(
    policy: PolicyLike, search: NamedSearch, seed: int, view: View
) -> Iterator[tuple[Frame, tuple[int, ...]]]:
    """Play one episode in two environments, which show the prior and the posterior.

    Of every step, from `reset` on, yields a frame with both and the return under the one that the
    policy sees; and the drones' actions. A batch with the same episode shows the policy its view.
    """
    envs = [
        DroneSwarmSearch(scenario=search.scenario.replace(bayesian_update=flag), render_mode=None)
        for flag in (False, True)
    ]
    for env in envs:
        env.reset(seed, drones_positions=search.drones)
    act = steering(policy, search, seed, view)
    chosen: tuple[int, ...] = ()
    while True:
        prior, posterior = (env.frame() for env in envs)
        total = (prior, posterior)[search.scenario.bayesian_update].total_return
        frame = replace(posterior, prior=prior.matrix, total_return=total)
        yield replace(frame, by_drone=frames_by_drone(envs[1])), chosen
        if not envs[0].agents:
            return
        actions = act()
        chosen = tuple(actions.values())
        for env in envs:
            env.step(actions)
