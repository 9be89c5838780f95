#  Copyright (c) Meta Platforms, Inc. and affiliates.
#
#  This source code is licensed under the license found in the
#  LICENSE file in the root directory of this source tree.
#

from dataclasses import MISSING, dataclass


@dataclass
class TaskConfig:
    observation: str = MISSING
    right_of_way: bool = MISSING
    shared_reward: bool = MISSING
    reward_scale: float = MISSING
    state: bool = MISSING
