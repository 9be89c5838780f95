"""Which cases are measured together, and which ratios are formed."""

from __future__ import annotations

from typing import NamedTuple

from DroneSwarmSearch.bench.cases import (
    DRONE_VIEW,
    DRONE_VIEW_INDEX,
    GATHER,
    INDEX,
    MATRICES,
    OWN_LAWS,
    POSTERIOR,
    SAMPLER,
    SINGLE,
    SINGLE_POSTERIOR,
    SWARM_VIEW,
    SWARM_VIEW_INDEX,
    BenchmarkCase,
)
from DroneSwarmSearch.bench.peers import COIN_GAME, COIN_GAME_SCAN, DSSE

__all__ = ["COIN_GAME_RATIOS", "GROUPS", "MEMORY", "PEERS", "Ratio"]


class Ratio(NamedTuple):
    """How many times the speed of another a case has."""

    of: BenchmarkCase
    to: BenchmarkCase

    def __str__(self) -> str:
        return f"{self.of.name} / {self.to.name}"


MEMORY, PEERS = "memory", "peers"

GROUPS = {
    "batch": (Ratio(INDEX, SINGLE), Ratio(MATRICES, SINGLE), Ratio(MATRICES, GATHER)),
    "posterior": (Ratio(POSTERIOR, SINGLE_POSTERIOR),),
    "forecasts": (Ratio(OWN_LAWS, MATRICES), Ratio(SAMPLER, MATRICES)),
    "views": (
        Ratio(SWARM_VIEW, MATRICES),
        Ratio(SWARM_VIEW_INDEX, INDEX),
        Ratio(DRONE_VIEW, MATRICES),
        Ratio(DRONE_VIEW_INDEX, INDEX),
    ),
    PEERS: (Ratio(INDEX, DSSE), Ratio(MATRICES, DSSE)),
    MEMORY: (),
}
"""The ratios that each group is measured for, at every size."""

COIN_GAME_RATIOS = (Ratio(INDEX, COIN_GAME), Ratio(INDEX, COIN_GAME_SCAN))
"""Those of the peers that are measured at a size of their own."""
