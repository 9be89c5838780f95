"""`python -m DroneSwarmSearch`."""

import sys

from DroneSwarmSearch.cli import main

if __name__ == "__main__":
    sys.exit(main())
