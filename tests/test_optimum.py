"""Exact plans against exhaustive search and published values."""

import sys

import numpy as np
import pytest
from documents import ROOT

from DroneSwarmSearch import Drift, MarkovDrift, Person, Scenario
from DroneSwarmSearch.core import Grid
from DroneSwarmSearch.planning import optimum, plan_paths, success_bound

pytest.importorskip("highspy")

sys.path.append(str(ROOT / "benchmarks"))
import optima


def random_chain(size, rng):
    """Transitions to cells side by side, some of them impossible: (N², N²)."""
    moves = np.zeros((size**2, size**2))
    for cell in range(size**2):
        near = [cell, *(each for each in Grid.of(size).neighbours[cell][:4] if each >= 0)]
        moves[cell, near] = rng.dirichlet(np.full(len(near), 0.6))
    return moves


def looks_of_paths(size, start, steps, in_flight):
    """What one drone may look at, a row for each path: the cell in each step, or -1."""
    paths = [((start,), ())]
    for _ in range(steps):
        longer = []
        for cells, looks in paths:
            here = cells[-1]
            longer.append(((*cells, here), (*looks, here)))
            for there in Grid.of(size).neighbours[here][:4]:
                if there >= 0:
                    longer.append(((*cells, there), (*looks, there if in_flight else -1)))
        paths = longer
    return np.unique([looks for _, looks in paths], axis=0)


def most_found(scenario, starts):
    """The largest probability of success, by trying all paths along all trajectories."""
    size = scenario.grid_size
    steps = scenario.timestep_limit
    model = scenario.forecasts()[0]
    moves = np.array(
        [model.forward(each, 0).ravel() for each in np.eye(size**2).reshape(-1, 1, size, size)]
    )
    trajectories = [(p, (cell,)) for cell, p in enumerate(model.joint(0).ravel()) if p > 0]
    for _ in range(steps - 1):
        trajectories = [
            (p * moves[cells[-1], cell], (*cells, cell))
            for p, cells in trajectories
            for cell in moves[cells[-1]].nonzero()[0]
        ]
    chances = np.array([p for p, _ in trajectories])
    along = np.array([cells for _, cells in trajectories])
    counts = []
    for start in starts:
        looks = looks_of_paths(size, start, steps, scenario.search_in_flight)
        counts.append((looks[:, None] == along).sum(axis=2).astype(np.int8))
    missed = 1 - scenario.detections[0]
    if len(starts) == 1:
        return 1 - (missed ** counts[0] @ chances).min()
    return 1 - min((missed ** (counts[1] + row) @ chances).min() for row in counts[0])


@pytest.mark.thorough
@pytest.mark.parametrize("seed", range(4))
@pytest.mark.parametrize("in_flight", [False, True])
@pytest.mark.parametrize(("drones", "steps"), [(1, 6), (2, 4)])
def test_it_is_that_of_exhaustive_search(drones, steps, in_flight, seed):
    rng = np.random.default_rng(seed)
    scenario = Scenario(
        3,
        n_drones=drones,
        timestep_limit=steps,
        persons=[
            Person(
                MarkovDrift(rng.dirichlet(np.ones(9)).reshape(3, 3), random_chain(3, rng)),
                probability_of_detection=[1.0, 0.9, 0.5, 0.2][seed],
            )
        ],
        search_in_flight=in_flight,
        crash="pass",
    )
    starts = rng.integers(0, 3, (drones, 2)).tolist()
    found = optimum(scenario, starts)
    assert found.is_proven
    most = most_found(scenario, [x + 3 * y for x, y in starts])
    assert found.success == pytest.approx(most, abs=5e-6)
    assert most <= found.bound
    check_paths(scenario, starts, found)


def check_paths(scenario, starts, found):
    """The paths are possible, and find the person as often as stated."""
    model = scenario.forecasts()[0]
    size = scenario.grid_size
    for (x, y), path in zip(starts, found.paths, strict=True):
        assert path.cells[0] == x + size * y
        for here, there, searches in zip(path.cells, path.cells[1:], path.searches, strict=False):
            assert there == here or there in Grid.of(size).neighbours[here][:4]
            assert searches == (scenario.search_in_flight or there == here)
    mass = model.joint(0)
    for step in range(scenario.timestep_limit):
        missed = np.ones(size**2)
        for path in found.paths:
            cell = path.cells[step + scenario.search_in_flight]
            if path.searches[step]:
                missed[cell] *= 1 - scenario.detections[0]
        mass = mass * model.lift(missed.reshape(size, size))
        if step < scenario.timestep_limit - 1:
            mass = model.forward(mass, step)
    assert 1 - mass.sum() == pytest.approx(found.success, abs=1e-9)


@pytest.mark.thorough
@pytest.mark.good_plans
def test_it_is_between_plan_and_bound():
    drifts = [
        Drift((1, 1), start_sd=0.8, vector=(0.4, 0.1), diffusion=0.1),
        Drift((2, 2), start_sd=0.6, vector=(-0.3, 0.3), diffusion=0.2),
    ]
    scenario = Scenario(
        4, n_drones=2, timestep_limit=5, persons=[Person(drifts, 0.7)], crash="pass"
    )
    starts = [(0, 0), (0, 0)]
    found = optimum(scenario, starts)
    assert found.is_proven
    check_paths(scenario, starts, found)
    assert plan_paths(scenario, starts, seconds=1).by_time[-1] <= found.bound + 1e-9
    assert success_bound(scenario, starts).by_limit >= found.success - 1e-9


def test_without_time_there_is_a_plan_and_a_bound():
    scenario = optima.royset(9, 8, 3)
    found = optimum(scenario, [(0, 0)] * 3, seconds=1e-3)
    assert not found.is_proven
    assert 0.3 < found.success < 0.3127 < found.bound <= 1.0
    check_paths(scenario, [(0, 0)] * 3, found)


def test_published_optima():
    for name in ("eagle-2-1", "royset-9-7-3"):
        posed = optima.searches()[name]
        found = optimum(posed.scenario, posed.starts)
        assert found.is_proven
        assert 1 - found.success == pytest.approx(posed.published.missed, abs=5e-5)


def test_the_table_shows_the_results():
    assert optima.PAGE.read_text("utf-8") == optima.page(), "run benchmarks/optima.py report"
    published = {name: posed.published for name, posed in optima.searches().items()}
    for name, row in optima.read_rows().items():
        best = float(row["best"])
        bound = float(row["bound"])
        assert bound <= best + 1e-6
        assert bound <= published[name].missed + 5e-5
        if best - bound <= optima.PROVEN and "gap" not in published[name].gurobi:
            assert best == pytest.approx(published[name].missed, abs=5e-5)
        assert best < published[name].missed + 3e-4


@pytest.mark.parametrize(
    ("changes", "message"),
    [
        ({"crash": "block"}, "scenario must have crash='pass', got 'block'"),
        ({"n_persons": 2}, "scenario must have one person"),
        ({"grid_size": 40, "timestep_limit": 60}, "scenario must be small"),
    ],
)
def test_what_it_cannot_do_is_refused(changes, message):
    size = changes.get("grid_size", 4)
    drifts = [Drift((size // 2, k), vector=(0.1 * k, 0), diffusion=0.1) for k in range(2)]
    values = {"grid_size": 4, "timestep_limit": 5, "crash": "pass", **changes}
    persons = [Person(drift) for drift in drifts[: values.pop("n_persons", 1)]]
    scenario = Scenario(n_drones=1, persons=persons, **values)
    with pytest.raises(ValueError, match=message):
        optimum(scenario, [(0, 0)])
    with pytest.raises(ValueError, match="seconds must be"):
        optimum(scenario, [(0, 0)], seconds=0)
