#  Copyright (c) Meta Platforms, Inc. and affiliates.
#
#  This source code is licensed under the license found in the
#  LICENSE file in the root directory of this source tree.
#

from benchmarl.environments.droneswarmsearch.drift import TaskConfig

__all__ = ["TaskConfig"]
