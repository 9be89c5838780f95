"""Tools for training scripts: a task, command-line options, checkpoints, curves, baselines.

    options = training.arguments("PPO on my trainer.", steps=200_000, short=2_000).parse_args()
    with training.Run(options, "My trainer") as run:
        ...
            with run.saving("checkpoint.pt") as path:
                torch.save(model.state_dict(), path)
            run.log(steps, reward=mean_return, found=success_rate)
    training.compare_with_baselines(policy, training.TRAINING_TASK, folder=run.folder)

The module is independent of any RL library. Steps are environment steps: in one step, every
drone of a swarm acts once.
"""

from DroneSwarmSearch.training.comparison import compare_with_baselines
from DroneSwarmSearch.training.expected_searches import ExpectedSearches
from DroneSwarmSearch.training.interrupts import exit_on_interrupt
from DroneSwarmSearch.training.options import arguments
from DroneSwarmSearch.training.run import Run
from DroneSwarmSearch.training.task import TRAINING_TASK

__all__ = [
    "TRAINING_TASK",
    "ExpectedSearches",
    "Run",
    "arguments",
    "compare_with_baselines",
    "exit_on_interrupt",
]
