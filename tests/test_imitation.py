"""The trained policy: its network, its file format, and its safety and success."""

from itertools import pairwise
from typing import Any

import numpy as np
import pytest

from DroneSwarmSearch import Scenario
from DroneSwarmSearch.evaluation import NamedSearch, compare, evaluate
from DroneSwarmSearch.policies import ImitationPolicy, Network, make
from DroneSwarmSearch.policies.arrivals import INPUTS, VIEWS

Layers = list[tuple[np.ndarray, np.ndarray]]


def layers(*widths: int, seed: int = 0) -> Layers:
    """Random weights and biases."""
    rng = np.random.default_rng(seed)
    return [
        (rng.normal(size=shape).astype(np.float32), rng.normal(size=shape[1]).astype(np.float32))
        for shape in pairwise(widths)
    ]


def network_layers(*hidden: int, seed: int = 0) -> Layers:
    """Random layers of a network: the last one also sees the inputs."""
    rng = np.random.default_rng(seed)
    made = layers(INPUTS, *hidden, 2, seed=seed)
    weights, biases = made[-1]
    skip = rng.normal(size=(INPUTS, 2)).astype(np.float32)
    return [*made[:-1], (np.concatenate([weights, skip]), biases)]


def scenario(**parameters: Any) -> Scenario:
    return Scenario(**{"grid_size": 8, "n_drones": 2, **parameters})


class TestNetwork:
    def test_is_a_perceptron_whose_last_layer_also_sees_the_inputs(self):
        (first, bias), (second, offset) = made = network_layers(4)
        seen = np.random.default_rng(1).random((3, INPUTS)).astype(np.float32)
        moves = []
        searches = []
        for view in VIEWS:  # right, down, left, up
            hidden = seen[:, view] @ first + bias
            assert (hidden < 0).any()
            last = np.concatenate([np.where(hidden > 0, hidden, 0), seen[:, view]], axis=1)
            ahead, search = (last @ second + offset).T
            moves.append(ahead)
            searches.append(search)
        right, down, left, up = moves
        wanted = np.stack([left, right, up, down, np.mean(searches, axis=0)], axis=1)
        assert np.allclose(Network(made)(seen), wanted, rtol=1e-4, atol=1e-3)

    @pytest.mark.parametrize(
        ("made", "message"),
        [
            (layers(INPUTS, 6), r"layers must end in 2 outputs, .*, got 6"),
            (layers(INPUTS, 8, 2), rf"layers\[1\] must have .*\({INPUTS + 8}, outputs\)"),
            ([(np.zeros((INPUTS, 2)), np.zeros(4))], r"as many biases as outputs, got .*\(4,\)"),
        ],
    )
    def test_rejects_layers_that_do_not_fit(self, made, message):
        with pytest.raises(ValueError, match=message):
            Network(made)

    @pytest.mark.parametrize(
        ("arrays", "message"),
        [
            ({"weights0": np.full((INPUTS, 2), np.nan)}, "its numbers must be finite"),
            ({"weights0": np.float64(1.0)}, r"layers\[0\] must have weights of shape"),
            ({"weights1": np.zeros((2, 2))}, "biases1"),
        ],
    )
    def test_rejects_files_without_a_network(self, tmp_path, arrays, message):
        path = tmp_path / "weights.npz"
        with pytest.raises(FileNotFoundError):
            Network.load(path)
        path.write_bytes(b"no archive")
        with pytest.raises(ValueError, match=r"weights\.npz must hold a network's weights"):
            Network.load(path)
        np.savez(path, **{"weights0": np.zeros((INPUTS, 2)), "biases0": np.zeros(2), **arrays})
        with pytest.raises(ValueError, match=rf"weights\.npz must hold .*: .*{message}"):
            Network.load(path)

    def test_never_unpickles(self, tmp_path):
        path = tmp_path / "weights.npz"
        np.savez(path, weights0=np.array([{}], object), biases0=np.zeros(2), allow_pickle=True)
        with pytest.raises(ValueError, match="must hold a network's weights"):
            Network.load(path)


class TestSimulations:
    def test_with_one_person_it_is_never_below_its_parts(self):
        """Compared by the exact probability of success, from a coverage mission."""
        drawn = scenario(
            grid_size=12,
            vector=(-0.4, 0.7),
            person_initial_position=(8, 3),
            disperse_constant=8,
            timestep_limit=25,
            probability_of_detection=0.6,
            mission="coverage",
        )
        parts = [ImitationPolicy(drawn, samples=None), make("greedy-forecast", drawn)]
        fewer, found, *others = (
            evaluate(policy, drawn, episodes=1).success.value
            for policy in (ImitationPolicy(drawn, samples=0), ImitationPolicy(drawn), *parts)
        )
        assert fewer == pytest.approx(max(others)) and found >= max(*others, fewer) - 1e-9


@pytest.mark.thorough
def test_the_default_weights_beat_a_pattern_on_a_search_outside_training():
    drawn = scenario(
        grid_size=13,  # smaller than any grid of the training
        n_drones=3,
        vector=(0.3, -0.2),
        person_initial_position=(5, 8),
        disperse_constant=6.0,
        timestep_limit=40,
    )
    of = NamedSearch("drawn", "Not trained on.", drawn)
    imitation, pattern = (
        evaluate(name, of, episodes=1) for name in ("imitation", "parallel-sweep")
    )
    assert compare(imitation, pattern).success.value > 0.01
