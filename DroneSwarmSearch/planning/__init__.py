"""Search planning: open-loop plans for all drones, and an upper bound on their success.

- `paths`: the best path of one drone for given gains, by dynamic programming.
- `plan`: plans for all drones together, improved one segment of one drone's path at a time
  (`segments`), by the gains that a forward and a backward pass give (`passes`).
- `bound`: an upper bound on every policy's probability of success, from `frank_wolfe` (the
  optimiser), `objectives` (the functions to maximise), `memory` (drones that remember their last
  actions) and `trajectories` (of the person).
"""

from DroneSwarmSearch.planning.bound import SuccessBound, success_bound

__all__ = ["SuccessBound", "success_bound"]
