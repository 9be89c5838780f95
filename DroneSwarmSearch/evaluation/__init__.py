"""Evaluate policies on a fixed suite of searches, with confidence intervals.

from DroneSwarmSearch.evaluation import compare, evaluate

mine = evaluate(my_policy, "classic")
greedy = evaluate("greedy-posterior", "classic")
print(mine.success, mine.time, compare(mine, greedy))
"""

from DroneSwarmSearch._internal.files import StorageError
from DroneSwarmSearch.core.named_search import NamedSearch
from DroneSwarmSearch.evaluation.board import leaderboard
from DroneSwarmSearch.evaluation.episodes import Episodes
from DroneSwarmSearch.evaluation.exporting import export
from DroneSwarmSearch.evaluation.recording import Video, record
from DroneSwarmSearch.evaluation.results import Comparison, Evaluation, compare, save_csv
from DroneSwarmSearch.evaluation.rollout import roll_out, share_found
from DroneSwarmSearch.evaluation.run import evaluate
from DroneSwarmSearch.evaluation.statistics import (
    Estimate,
    bounded_mean,
    difference,
    mean_of,
    stratified_mean,
)
from DroneSwarmSearch.evaluation.suite import SUITE, search
from DroneSwarmSearch.layouts.view import View

__all__ = [
    "SUITE",
    "Comparison",
    "Episodes",
    "Estimate",
    "Evaluation",
    "NamedSearch",
    "StorageError",
    "Video",
    "View",
    "bounded_mean",
    "compare",
    "difference",
    "evaluate",
    "export",
    "leaderboard",
    "mean_of",
    "record",
    "roll_out",
    "save_csv",
    "search",
    "share_found",
    "stratified_mean",
]
