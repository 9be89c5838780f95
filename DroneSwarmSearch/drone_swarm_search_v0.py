"""The environment under the name of its behaviour, as PettingZoo names environments.

```python
from DroneSwarmSearch import drone_swarm_search_v0

env = drone_swarm_search_v0.parallel_env(grid_size=20, n_drones=4)
```

The number at the end is that of the behaviour: what `reset` and `step` return for given
parameters, actions and seed. When a release changes any of that, the number rises and the
module of the old one is gone, so that code which asks for it fails at the import, rather than
computing other figures. CONTRIBUTING.md has the rules.
"""

from __future__ import annotations

from typing import Any

from pettingzoo import AECEnv

from DroneSwarmSearch._internal.turn_based import TurnBased
from DroneSwarmSearch.env import env, parallel_env
from DroneSwarmSearch.observations import Observation

__all__ = ["env", "parallel_env", "raw_env"]


def raw_env(**kwargs: Any) -> AECEnv[str, Observation, int | None]:
    """The environment in PettingZoo's AEC form, without the wrapper that checks the order."""
    return TurnBased(parallel_env(**kwargs))
