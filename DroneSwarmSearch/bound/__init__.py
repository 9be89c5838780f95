"""Upper bounds on the success of any policy, and the best paths of drones for given gains."""
