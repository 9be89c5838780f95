"""Adapters for RL libraries: one module per library, behind the extra of the same name.

Nothing else in the package imports them, and this module imports none of them.
"""
