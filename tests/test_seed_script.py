"""The sample script of the 2023 package's README runs unchanged."""

from __future__ import annotations

import os
import subprocess
import sys

SCRIPT = """\
from DroneSwarmSearchEnvironment.env import DroneSwarmSearch
env = DroneSwarmSearch(
    grid_size=50,
    render_mode="human",
    render_grid = True,
    render_gradient = True,
    n_drones=11,
    vector=[0.5, 0.5],
    person_initial_position = [5, 10],
    disperse_constant = 3)

def policy(obs, agent):
    actions = {}
    for i in range(11):
        actions["drone{}".format(i)] = 1
    return actions

observations = env.reset()
rewards = 0
done = False

while not done:
    actions = policy(observations, env.get_agents())
    observations, reward, _, done, info = env.step(actions)
    rewards += reward["total_reward"]
    done = True if True in [e for e in done.values()] else False

print(rewards)
"""


FAST = """
import runpy, sys
from DroneSwarmSearch import DroneSwarmSearch
DroneSwarmSearch.metadata["render_fps"] = 1000
runpy.run_path(sys.argv[1], run_name="__main__")
"""
"""Runs a script without the pauses between frames."""


def test_seed_script(tmp_path):
    script = tmp_path / "script.py"
    script.write_text(SCRIPT, encoding="utf-8")
    run = subprocess.run(
        [sys.executable, "-c", FAST, str(script)],
        cwd=tmp_path,
        env={**os.environ, "SDL_VIDEODRIVER": "dummy"},
        capture_output=True,
        text=True,
        timeout=60,
        check=False,
    )
    assert (run.returncode, run.stderr) == (0, "")
    # The drones stand in columns 0 to 10 and fly right: 39 steps of 1 for each of them;
    # in the next, drone 10 leaves the grid from column 49.
    assert float(run.stdout) == 39 * 11 + 10 - 100_000
