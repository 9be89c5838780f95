"""The runs of the benchmark as its page has them: shared by tests."""

import algorithms

RESULTS, CURVES = (algorithms.rows_of(path) for path in (algorithms.RESULTS, algorithms.CURVES))


RUNS = {tuple(row[name] for name in algorithms.KEY): row for row in RESULTS}
