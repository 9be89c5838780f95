"""The inputs of the trained network, and the simulation in expectation that it is trained in."""

from typing import Any

import numpy as np
import pytest
from trainer_examples import module

from DroneSwarmSearch import Action, Drift, DroneSwarmSearch, Person, Scenario
from DroneSwarmSearch.core import choose_in_turn
from DroneSwarmSearch.policies import BeliefTracker, PosteriorGreedyPolicy, make
from DroneSwarmSearch.policies.arrivals import BASELINE, FAR, NEAR, TURNS, VIEWS, Arrivals
from DroneSwarmSearch.policies.greedy import WORTHWHILE_ON_ARRIVAL, claimed_in_turn

ExpectedSearches: Any = module("expected_searches").ExpectedSearches

SIZE = 9
DRONES = 3
STEPS = 6
TOWARDS = {Action.RIGHT: (1, 0), Action.DOWN: (0, 1), Action.LEFT: (-1, 0), Action.UP: (0, -1)}


def drawn(seed: int = 0) -> dict[str, Any]:
    """Random arguments of `Arrivals.inputs` for two searches."""
    rng = np.random.default_rng(seed)
    cells = np.stack([rng.permutation(SIZE**2)[:DRONES] for _ in range(2)])
    return {
        "ahead": rng.random((2, STEPS + 1, SIZE, SIZE)).astype(np.float32) ** 4,
        "positions": np.stack([cells % SIZE, cells // SIZE], -1),
        "remaining": np.array([20, 5]),
        "limit": 30,
        "detections": np.array([0.4, 1.0], np.float32),
        "headings": np.array([[Action.LEFT, Action.IDLE, Action.UP]] * 2),
    }


def inputs(**arguments: Any) -> np.ndarray:
    n_drones = arguments["positions"].shape[1]
    return Arrivals(arguments["ahead"].shape[-1], n_drones).inputs(**arguments)


def test_scores_are_those_of_the_best_cells_on_arrival():
    """Compared with loops over cells, for one drone: nobody else claims a cell."""
    arguments = drawn()
    for key in ("positions", "headings"):
        arguments[key] = arguments[key][:, :1]
    seen = inputs(**arguments)[:, 0]
    ahead = arguments["ahead"]
    for search in range(2):
        px, py = arguments["positions"][search, 0]
        remaining = arguments["remaining"][search]
        for factor, shift in ((NEAR, 0), (FAR, 5)):
            best = dict.fromkeys([*TURNS, Action.SEARCH], 0.0)
            distances = {
                (x, y): distance
                for y in range(SIZE)
                for x in range(SIZE)
                if (distance := abs(x - px) + abs(y - py)) < remaining
            }
            arrivals = {
                (x, y): ahead[search, min(distance, STEPS), y, x]
                for (x, y), distance in distances.items()
            }
            worthwhile = WORTHWHILE_ON_ARRIVAL * max(arrivals.values()) if factor == NEAR else 0.0
            for (x, y), distance in distances.items():
                value = factor**distance * arrivals[x, y]
                if arrivals[x, y] < worthwhile:
                    continue
                for action, (dx, dy) in TOWARDS.items():
                    if (x - px) * dx + (y - py) * dy > 0:
                        best[action] = max(best[action], value)
                if distance == 0:
                    best[Action.SEARCH] = value
            highest = max(best.values())
            scores = [np.log(max(value / highest, 1e-5)) / 2 for value in best.values()]
            first = BASELINE[0] + shift
            assert np.allclose(seen[search, first : first + 5], scores, atol=1e-4)


def test_drones_claim_the_targets_of_greedy_search():
    rng = np.random.default_rng(3)
    size = 12
    drones = 7
    greedy = PosteriorGreedyPolicy(Scenario(grid_size=size, n_drones=drones))
    values = rng.random((5, drones, size, size)) ** 8  # some cells are far more likely
    x, y = rng.integers(0, size, (2, 5, drones))
    axis = np.arange(size)
    distances = np.abs(axis - x[..., None])[:, :, None] + np.abs(axis - y[..., None])[..., None]
    claims = claimed_in_turn((values * NEAR**distances).reshape(5, drones, -1))
    for search in range(5):
        cells = [*zip(x[search].tolist(), y[search].tolist(), strict=True)]
        targets = dict(greedy._targets(cells, values[search]))
        assert [targets[k][1] * size + targets[k][0] for k in range(drones)] == [*claims[search]]


def test_turned_searches_have_turned_inputs():
    """In view k, everything is as it would be in view 0 after turning the search k times."""
    arguments = drawn(1)
    seen = inputs(**arguments)
    for turn in range(1, 4):
        # A quarter turn to the left takes (x, y) to (y, N - 1 - x), and down to the right.
        arguments["ahead"] = np.rot90(arguments["ahead"], axes=(2, 3)).copy()
        x, y = np.moveaxis(arguments["positions"], -1, 0)
        arguments["positions"] = np.stack([y, SIZE - 1 - x], -1)
        turns = [*reversed(TURNS)]  # to the left
        after = {move: turns[place - 3] for place, move in enumerate(turns)}
        arguments["headings"] = np.vectorize(lambda move, after=after: after.get(move, move))(
            arguments["headings"]
        )
        assert np.allclose(inputs(**arguments)[..., VIEWS[0]], seen[..., VIEWS[turn]], atol=1e-3)


def searches(count: int = 3, persons: int = 2, detection: float = 0.6) -> Any:
    """The arguments of `ExpectedSearches`: uncertain persons, two hypotheses about the first."""
    rng = np.random.default_rng(5)

    def person(hypotheses: int) -> Person:
        drifts = [
            Drift((4, 5), start_sd=1.0, vector=rng.uniform(-1, 1, 2), diffusion=0.2)
            for _ in range(hypotheses)
        ]
        return Person(drifts, detection)

    size = {"grid_size": 9, "n_drones": 3, "timestep_limit": 15}
    scenarios = [
        Scenario(**size, persons=[person(n) for n in (2, 1)[:persons]], mission="coverage")
        for _ in range(count)
    ]
    return scenarios, [[(0, 0), (4, 4), (8, 1)]] * count


class TestExpectedSearches:
    def test_agree_with_the_tracked_belief(self):
        scenarios, starts = searches()
        batch = ExpectedSearches(scenarios, starts)
        rng = np.random.default_rng(0)
        trackers = [*map(BeliefTracker, scenarios)]
        arrivals = Arrivals(9, 3)
        while batch.step < batch.timestep_limit:
            remaining = 15 - batch.step
            seen = batch.inputs()
            for number, tracker in enumerate(trackers):
                ahead = tracker.success_ahead(arrivals.steps(remaining))
                here = slice(number, number + 1)
                wanted = arrivals.inputs(
                    (ahead / ahead[0].max())[None].astype(np.float32),
                    batch.positions[here],
                    np.array([remaining]),
                    15,
                    np.array([0.6]),
                    np.array([tracker.headings]),
                )
                assert np.allclose(seen[number], wanted[0], atol=0.01)
            actions, _ = choose_in_turn(rng.random((3, 3, 5)), batch.cells, 9)
            for number, tracker in enumerate(trackers):
                tracker.update([*map(tuple, batch.positions[number].tolist())], actions[number])
            batch.advance(actions)

    @pytest.mark.parametrize("persons", [1, 2])
    def test_rewards_add_up_to_the_probability_of_success(self, persons):
        """The environment computes the same in its coverage mission."""
        scenarios, starts = searches(1, persons)
        env = DroneSwarmSearch(scenario=scenarios[0])
        observations, infos = env.reset(options={"drones_positions": starts[0]})
        batch = ExpectedSearches(scenarios, starts)
        policy = make("greedy-posterior", env.scenario)
        total = 0.0
        while env.agents:
            actions = policy(observations)
            rewards = batch.advance(np.array([[*actions.values()]]))
            assert (rewards >= 0).all()
            total += rewards.sum()
            observations, _, _, _, infos = env.step(actions)
        assert total == pytest.approx(float(batch.found[0])) and total > 0.2
        wanted = infos["drone0"]["probability_of_success"]
        assert total == pytest.approx(wanted, abs=1e-5)
