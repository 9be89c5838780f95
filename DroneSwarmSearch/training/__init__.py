"""What the training examples share: the search, the options, the record, the comparison.

    options = training.arguments("PPO on my trainer.", steps=200_000, short=2_000).parse_args()
    with training.Run(options, "My trainer") as run:
        ...
            with run.saving("checkpoint.pt") as path:
                torch.save(model.state_dict(), path)
            run.log(steps, reward=mean_return, found=share_found)
    training.compare_with_baselines(policy, training.TRAINING_TASK, folder=run.folder)

Nothing here knows of any trainer. Steps are environment steps, in which every drone of a
swarm acts once.
"""

from DroneSwarmSearch.training.comparison import compare_with_baselines
from DroneSwarmSearch.training.masks import masks_of_flat
from DroneSwarmSearch.training.options import arguments
from DroneSwarmSearch.training.run import Run
from DroneSwarmSearch.training.task import TRAINING_TASK

__all__ = ["TRAINING_TASK", "Run", "arguments", "compare_with_baselines", "masks_of_flat"]
