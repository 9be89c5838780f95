"""The runs of the benchmark as its page has them: shared by tests."""

import sys
from pathlib import Path

sys.path.append(str(Path(__file__).parents[1] / "benchmarks"))

import algorithms

RESULTS, CURVES = (algorithms.rows_of(path) for path in (algorithms.RESULTS, algorithms.CURVES))


RUNS = {tuple(row[name] for name in algorithms.KEY): row for row in RESULTS}
