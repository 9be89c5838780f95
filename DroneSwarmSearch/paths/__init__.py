"""Paths of drones: the best one for given gains, and plans for all drones together."""
