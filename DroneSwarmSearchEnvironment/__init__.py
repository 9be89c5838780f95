"""The import path of the 2023 package; everything is in `DroneSwarmSearch`."""

from DroneSwarmSearch import *  # noqa: F403
from DroneSwarmSearch import __all__, __version__  # noqa: F401
