"""The environment under its versioned id, as PettingZoo names environments.

```python
from DroneSwarmSearch import drone_swarm_search_v0

env = drone_swarm_search_v0.parallel_env(grid_size=20, n_drones=4)
```

The number is the version of the behaviour: what `reset` and `step` return for given parameters,
actions and seed. A release that changes any of that increases the number and removes the old
module. Code that imports the old module then fails, instead of producing different results.
See CONTRIBUTING.md.
"""

from __future__ import annotations

from typing import Any

from pettingzoo import AECEnv
from pettingzoo.utils.conversions import parallel_to_aec_wrapper

from DroneSwarmSearch.core.observations import Observation
from DroneSwarmSearch.env import env, parallel_env

__all__ = ["env", "parallel_env", "raw_env"]


def raw_env(**kwargs: Any) -> AECEnv[str, Observation, int | None]:
    """The environment in PettingZoo's AEC form, without checks of calls and actions."""
    return parallel_to_aec_wrapper(parallel_env(**kwargs))
