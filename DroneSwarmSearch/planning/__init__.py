"""Search planning: open-loop plans for all drones, an upper bound, and the exact optimum.

- `paths`: the best path of one drone for given gains, by dynamic programming.
- `plan`: plans for all drones together, improved one segment of one drone's path at a time
  (`segments`), by the gains that a forward and a backward pass give (`passes`).
- `bound`: an upper bound on every policy's probability of success, from `frank_wolfe` (the
  optimiser), `objectives` (the functions to maximise), `memory` (drones that remember their last
  actions) and `trajectories` (of the person).
- `exact`: the best plan of a small search, by branch and bound.
"""

from DroneSwarmSearch.planning.bound import SuccessBound, success_bound
from DroneSwarmSearch.planning.exact import BestPlan, best_plan, best_success

__all__ = ["BestPlan", "SuccessBound", "best_plan", "best_success", "success_bound"]
