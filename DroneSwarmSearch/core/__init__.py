"""The search: its parameters, its rules, and the state of an episode."""
