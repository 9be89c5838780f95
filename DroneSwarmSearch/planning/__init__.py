"""Search planning over the forecast forecast: paths, plans for all drones, and an upper bound.

- `chain`: a person's chain, forecast forth and back.
- `paths`: the best path of one drone for given gains, a dynamic programme.
- `plan`: plans for all drones together, improved one drone at a time.
- `bound`: a limit on what any policy can reach.
- `exact`: the best plan of a small search, by branch and bound.
"""

from DroneSwarmSearch.planning.bound import SuccessBound, success_bound
from DroneSwarmSearch.planning.exact import best_success

__all__ = ["SuccessBound", "best_success", "success_bound"]
