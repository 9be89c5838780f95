"""Traces of named episodes as readable text; run this file to regenerate them.

    python tests/golden/regenerate.py            after a wanted change: the diff is the review
    python tests/golden/regenerate.py --release  as a step of a release, see CONTRIBUTING.md

`test_golden.py` plays the scenarios again and compares line by line. `released.txt` holds a digest
of each trace, frames left out, for every id that was released: its episodes are never changed.
"""

import argparse
import hashlib
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import numpy as np

from DroneSwarmSearch import Action, Drift, DroneSwarmSearch, Person, RewardScheme

FOLDER = Path(__file__).parent
RELEASED = FOLDER / "released.txt"  # in each line an id, a scenario and a digest
ID = str(DroneSwarmSearch.metadata["name"])

LETTERS = {action.name[0]: action for action in Action}

CORNERS = np.zeros((6, 6))  # a prior: the corner cells, two of them less likely
CORNERS[::5, ::5] = [[3, 1], [1, 3]]


@dataclass(frozen=True)
class Scenario:
    """An episode: what it shows, the arguments, and each step's actions, a letter per drone."""

    shows: str
    parameters: dict[str, Any]
    reset: dict[str, Any]
    steps: str
    then: list[str] = field(default_factory=list)


TOGETHER = Person(
    [
        Drift((2, 2), vector=(0.3, 0), diffusion=0.05, adrift=5),
        Drift((2, 2), vector=(0, 0.3), diffusion=0.05, adrift=5),
    ],
    probability_of_detection=0.8,
)
"""One of two persons who drift by the same of two hypotheses."""

SCENARIOS = {
    "find": Scenario(
        "A lone drone searches a wrong cell, flies where the drift leads, and finds the person.",
        {
            "grid_size": 5,
            "vector": (1, 0),
            "person_initial_position": (0, 1),
            "disperse_constant": 0,
            "timestep_limit": 10,
        },
        {"seed": 1},
        "D S R R R R S",
    ),
    "collision": Scenario(
        "Two drones exchange cells safely; later two collide, and the third is not penalised.",
        {"grid_size": 4, "n_drones": 3, "person_initial_position": (3, 3)},
        {"seed": 2},
        "RLI LRI RDD RSU",
    ),
    "left_grid": Scenario(
        "A drone leaves the grid; another enters its cell, which is no collision.",
        {"grid_size": 4, "n_drones": 2, "person_initial_position": (2, 2)},
        {"seed": 3, "drones_positions": [(0, 2), (2, 2)]},
        "IL LL",
    ),
    "time_limit": Scenario(
        "Likely and unlikely cells are searched without success until the time limit.",
        {
            "grid_size": 6,
            "n_drones": 2,
            "vector": (0.25, 0.25),
            "person_initial_position": (2, 2),
            "probability_of_detection": 0,
            "timestep_limit": 6,
        },
        {"seed": 4, "drones_positions": [(2, 2), (5, 5)]},
        "SS SI RS SI DS SI",
    ),
    "persons": Scenario(
        "Three persons, unreliable searches and the posterior; the mission is to find them all.",
        {
            "grid_size": 6,
            "n_drones": 3,
            "vector": (0, 0),
            "person_initial_position": [(1, 1), (4, 4), (4, 4)],
            "disperse_constant": 0,
            "probability_of_detection": [1, 0.5, 0.25],
            "bayesian_update": True,
            "timestep_limit": 30,
        },
        {"seed": 5, "drones_positions": [(1, 1), (4, 4), (0, 5)]},
        "ISI ISI SSI",
    ),
    "posterior": Scenario(
        "Searched cells lose their probability, and drift fills them again.",
        {
            "grid_size": 7,
            "n_drones": 4,
            "vector": (0.1, -0.1),
            "person_initial_position": (3, 3),
            "disperse_constant": 5,
            "probability_of_detection": 0.6,
            "bayesian_update": True,
            "timestep_limit": 6,
        },
        {"seed": 6, "drones_positions": [(2, 3), (3, 2), (4, 3), (3, 4)]},
        "IIII SSSS LRRL SSSS IIII SIIS",
    ),
    "options": Scenario(
        "Options of reset: the vector stays in the next episode, the positions do not.",
        {
            "grid_size": 5,
            "n_drones": 2,
            "reward_scheme": RewardScheme.sparse(),
            "disperse_constant": 0,
            "timestep_limit": 3,
        },
        {
            "seed": 7,
            "options": {
                "vector": (0, 1),
                "drones_positions": [(4, 0), (4, 4)],
                "person_initial_position": (3, 3),
            },
        },
        "DU IS LL",
        then=["DI DD SS"],
    ),
    "hypotheses": Scenario(
        "Searches around the likelier of two positions fail; the person is found at the other one.",
        {
            "grid_size": 8,
            "n_drones": 2,
            "persons": Person(
                [
                    Drift((1.5, 2), start_sd=0.6, vector=(0.2, 0), vector_sd=0.1, weight=3),
                    Drift((6, 5), start_sd=(0.8, 0.5), diffusion=0.05, adrift=4, weight=1),
                ],
                probability_of_detection=0.9,
            ),
            "bayesian_update": True,
            "timestep_limit": 8,
        },
        {"seed": 19, "drones_positions": [(1, 2), (3, 4)]},
        "SR RR SD DR SS RS SU SS",
    ),
    "prior": Scenario(
        "Two persons, one from a prior of four cells; the matrix is the mean of their forecasts.",
        {
            "grid_size": 6,
            "persons": [
                Person(Drift(CORNERS, vector=(0.1, 0.1), diffusion=0.1)),
                Person(Drift((3, 2), diffusion=0.2), probability_of_detection=0.5),
            ],
            "timestep_limit": 5,
        },
        {"seed": 9, "drones_positions": [(3, 2)]},
        "S S S R S",
    ),
    "coverage": Scenario(
        "In the coverage mission nobody is found, and searches pay the success that they add.",
        {
            "grid_size": 5,
            "n_drones": 2,
            "persons": Person(Drift((2, 2), diffusion=0.05), probability_of_detection=0.8),
            "bayesian_update": True,
            "mission": "coverage",
            "timestep_limit": 20,
        },
        {"seed": 10, "drones_positions": [(2, 2), (2, 3)]},
        "SI SI SS RS SI LI SI UI SI DI LI SI",
    ),
    "wreck": Scenario(
        "A find tells where the other person is; the first drone hears of it, the third does not.",
        {
            "grid_size": 7,
            "n_drones": 3,
            "persons": [TOGETHER, TOGETHER],
            "bayesian_update": True,
            "shared_drift": True,
            "crash": "block",
            "radio_range": 2,
            "timestep_limit": 8,
        },
        {"seed": 4, "drones_positions": [(2, 2), (3, 2), (5, 5)]},
        "RSI SSI SSL SRS ISL",
    ),
    "in_flight": Scenario(
        "Drones pass each other and look where they arrive; the border keeps one where it is.",
        {
            "grid_size": 5,
            "n_drones": 2,
            "persons": Person(Drift((2, 2), diffusion=0.05), probability_of_detection=0.6),
            "bayesian_update": True,
            "crash": "pass",
            "search_in_flight": True,
            "timestep_limit": 8,
        },
        {"seed": 31, "drones_positions": [(1, 2), (1, 2)]},
        "LL LS RR RR SI UD RI LL",
    ),
}


def trace(scenario: Scenario, frames: bool = True) -> str:
    """A scenario's episodes as text, with the frames or with what counts as behaviour alone."""
    env = DroneSwarmSearch(**scenario.parameters)
    lines = [scenario.shows] if frames else []
    lines += [f"environment: {ID}", ""]
    lines += [f"{name} = {value}" for name, value in scenario.parameters.items()]
    for number, steps in enumerate([scenario.steps, *scenario.then]):
        arguments = scenario.reset if number == 0 else {}
        given = ", ".join(f"{name}={value}" for name, value in arguments.items())
        observations, _ = env.reset(**arguments)
        lines += ["", f"reset({given})", *shown(env, observations), *framed(env, frames)]
        for letters in steps.split():
            lines += ["", *step_lines(env, letters), *framed(env, frames)]
    return "\n".join(lines) + "\n"


def step_lines(env: DroneSwarmSearch, letters: str) -> list[str]:
    """Take a step; returns what it was and what it led to."""
    actions = [int(LETTERS[letter]) for letter in letters]
    taken = dict(zip(env.agents, actions, strict=True))
    observations, rewards, terminations, truncations, infos = env.step(taken)
    assert terminations == truncations
    name = "probability_of_success"
    success = [f"success  {infos[name]:.4f}"] if name in infos else []
    return [
        "actions  " + " ".join(LETTERS[letter].name.lower() for letter in letters),
        "rewards  " + " ".join(f"{points:.2f}" for points in rewards.values()),
        f"total    {rewards['total_reward']:.2f}",
        "ended    " + " ".join("yes" if over else "no" for over in terminations.values()),
        "found    " + " ".join("yes" if info["Found"] else "no" for info in infos.values()),
        *success,
        *shown(env, observations),
    ]


def shown(env: DroneSwarmSearch, observations: dict[str, Any]) -> list[str]:
    """The observation and the missing persons, in figures that distinguish different matrices."""
    views = [observations[agent]["observation"] for agent in env.possible_agents]
    different = {id(matrix): matrix.astype(np.float64) for _, matrix in views}
    rows, columns = np.indices((env.grid_size, env.grid_size))
    counts = env.state()[2].astype(int)
    missing = [f"({x}, {y})" for y, x in np.argwhere(counts) for _ in range(counts[y, x])]
    return [
        "drones   " + " ".join(f"({cell[0]}, {cell[1]})" for cell, _ in views),
        *(
            f"matrix   at most {matrix.max():.4f}, mean cell "
            f"({(matrix * columns).sum():.4f}, {(matrix * rows).sum():.4f})"
            for matrix in different.values()
        ),
        "persons  " + (" ".join(missing) or "none missing"),
    ]


def framed(env: DroneSwarmSearch, frames: bool) -> list[str]:
    """The frame as text, without the spaces at the ends of lines."""
    return [line.rstrip() for line in env.render().splitlines()] if frames else []


def path_of(name: str) -> Path:
    return FOLDER / f"{name}.txt"


def digest(scenario: Scenario) -> str:
    return hashlib.sha256(trace(scenario, frames=False).encode()).hexdigest()


def released() -> dict[str, str]:
    """The digests of this id's released episodes by scenario; empty if it was not released."""
    lines = [line.split() for line in RELEASED.read_text(encoding="utf-8").splitlines()]
    return {line[1]: line[2] for line in lines if line and line[0] == ID}


def broken() -> list[str]:
    """The scenarios whose episodes differ from those released under this id."""
    now = {name: digest(scenario) for name, scenario in SCENARIOS.items()}
    return [name for name, was in released().items() if now.get(name) != was]


def main(arguments: list[str] | None = None) -> None:
    """Regenerate every trace, unless episodes of a released id change; remove obsolete ones."""
    parser = argparse.ArgumentParser(description="Regenerate the traces of the named episodes.")
    parser.add_argument("--release", action="store_true", help="enter them as released")
    options = parser.parse_args(arguments)
    if names := broken():
        raise SystemExit(
            f"{ID} is released, and these are not its episodes any more: {', '.join(names)}.\n"
            "Nothing was written. If the change is not meant, undo it. If it is, give the\n"
            'environment the next id: "Versions" in CONTRIBUTING.md says where it stands.'
        )
    for name, scenario in SCENARIOS.items():
        path_of(name).write_text(trace(scenario), encoding="utf-8", newline="\n")
    for path in set(FOLDER.glob("*.txt")) - {RELEASED}:
        if path.stem not in SCENARIOS:
            path.unlink()
    if options.release:
        new = sorted(set(SCENARIOS) - set(released()))
        with RELEASED.open("a", encoding="utf-8", newline="\n") as file:
            file.writelines(f"{ID} {name} {digest(SCENARIOS[name])}\n" for name in new)


if __name__ == "__main__":
    main()
