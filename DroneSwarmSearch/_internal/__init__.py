"""Shared parts that are not public."""
