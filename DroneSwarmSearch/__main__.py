"""`python -m DroneSwarmSearch`: the demo in the terminal."""

import sys

from DroneSwarmSearch.demo import main

if __name__ == "__main__":
    sys.exit(main(["--text", *sys.argv[1:]]))
