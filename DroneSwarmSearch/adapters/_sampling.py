"""Reproducible samples from trained policies, independent of PyTorch's global random state."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from contextlib import contextmanager

import numpy as np
import torch

__all__ = ["SamplingPolicy"]


class SamplingPolicy:
    """The base class of trained policies, each with its own random generator."""

    def __init__(self) -> None:
        self.reset(seed=0)

    def reset(self, seed: int | Sequence[int], rows: None = None) -> None:
        """Seed the sampling of actions; `evaluate` calls this before it plays episodes.

        Args:
            seed: one seed, or one for each episode.
            rows: ignored.
        """
        self._generator = np.random.default_rng(seed)

    @contextmanager
    def _seeded_torch(self) -> Iterator[None]:
        """Seed PyTorch from the generator; afterwards, PyTorch's random state is as before."""
        seed = int(self._generator.integers(2**63))
        with_cuda = torch.cuda.is_initialized()
        devices = range(torch.cuda.device_count()) if with_cuda else ()
        with torch.random.fork_rng(devices=devices):
            torch.default_generator.manual_seed(seed)
            if with_cuda:
                torch.cuda.manual_seed_all(seed)
            yield
