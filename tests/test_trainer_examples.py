"""Short runs of the training examples, as users run them."""

import importlib.util
import re
import signal
import subprocess
import sys
import time
from functools import partial
from typing import Any

import pytest
from trainer_examples import EXAMPLES, python, rows

pytestmark = pytest.mark.slow


def example(name: str, package: str, script: str, policy: str, *arguments: object) -> Any:
    """An example as a test parameter; .ci/trainer selects those whose names begin alike."""
    missing = importlib.util.find_spec(package) is None
    skip = pytest.mark.skipif(missing, reason=f"{package} is not installed")
    return pytest.param(f"train_{script}.py", policy, arguments, id=name, marks=skip)


RUNNERS = ("--num-env-runners", 2, "--num-envs", 2)


@pytest.mark.parametrize(
    ("script", "policy", "arguments"),
    [
        example("plain-own-loop", "torch", "own_loop", "ppo", "--steps", 30_000),
        example("plain-policy", "torch", "imitation", "imitation", "--searches", 4),
        example("sb3", "sb3_contrib", "sb3", "maskable-ppo", "--steps", 10_000),
        example("torchrl-local", "torchrl", "torchrl", "torchrl-ppo", "--steps", 10_000),
        example(
            "torchrl-central",
            "torchrl",
            "torchrl",
            "torchrl-ppo",
            "--steps",
            10_000,
            "--critic",
            "central",
        ),
        example("benchmarl-ippo", "benchmarl", "benchmarl", "benchmarl-ippo", "--steps", 10_000),
        example(
            "benchmarl-mappo",
            "benchmarl",
            "benchmarl",
            "benchmarl-mappo",
            "--steps",
            10_000,
            "--algorithm",
            "mappo",
        ),
        example(
            "benchmarl-qmix",
            "benchmarl",
            "benchmarl",
            "benchmarl-qmix",
            "--steps",
            10_000,
            "--algorithm",
            "qmix",
        ),
        example(
            "benchmarl-drift",
            "benchmarl",
            "benchmarl",
            "benchmarl-iql",
            "--steps",
            10_000,
            "--algorithm",
            "iql",
            "--task",
            "drift",
        ),
        example("rllib-local", "lz4", "rllib", "rllib-ppo", "--steps", 4_000),
        example("rllib-runners", "lz4", "rllib", "rllib-ppo", "--steps", 4_000, *RUNNERS),
    ],
)
def test_it_trains_and_compares(script, policy, arguments, tmp_path):
    folder = tmp_path / "run"
    output = python(EXAMPLES / script, "--out", folder, "--episodes", 20, *arguments)
    protocol = "20 episodes, the same for all policies"
    if "drift" in arguments:
        protocol = "Means over the 500 held-out searches"
    assert f"\n{protocol}; 95% intervals" in output
    assert rows(folder / "evaluation.csv")[0]["policy"] == policy
    assert float(rows(folder / "evaluation.csv")[0]["success"]) > 0
    assert (folder / "curve.png").read_bytes().startswith(b"\x89PNG")
    assert (folder / "video.gif").read_bytes().startswith(b"GIF89a")
    if "benchmarl" in policy:  # it also has loggers of its own
        [logged] = folder.rglob("collection_probability_of_success.csv")
        assert len(logged.read_text("utf-8").splitlines()) == 2
    log = "curve.csv"
    steps = "steps"
    if script == "train_sb3.py":
        log = "progress_000000000.csv"
        steps = "time/total_timesteps"
    least = 4_000
    if script == "train_imitation.py":
        steps = "searches"
        least = 12
    counts = [int(row[steps]) for row in rows(folder / log)]
    assert counts == sorted(set(counts)) and counts[-1] >= least
    command = re.search(r"python -m DroneSwarmSearch (play .*)", output)
    assert command is not None
    played = python("-m", "DroneSwarmSearch", *command[1].split(), "--text", "--seed", 1)
    assert "of all persons would be found by now" in played


@pytest.mark.parametrize(
    ("script", "checkpoint", "curves"),
    [
        pytest.param("own_loop", "checkpoint.pt", "curve.csv", id="plain-own-loop"),
        pytest.param("sb3", "model*.zip", "progress_*.csv", id="sb3"),
    ],
)
@pytest.mark.skipif(sys.platform == "win32", reason="sends Ctrl-C as POSIX does")
def test_after_ctrl_c_it_resumes(script, checkpoint, curves, tmp_path):
    pytest.importorskip("torch" if script == "own_loop" else "sb3_contrib")
    folder = tmp_path / "run"
    command = [str(EXAMPLES / f"train_{script}.py"), "--out", str(folder), "--episodes", "20"]
    with subprocess.Popen(
        [sys.executable, *command, "--steps", "10_000_000"],
        stderr=subprocess.PIPE,
        text=True,
        # What runs in the background of a shell ignores Ctrl-C.
        preexec_fn=partial(signal.signal, signal.SIGINT, signal.SIG_DFL),
    ) as process:
        while process.poll() is None and not any(folder.glob(checkpoint)):
            time.sleep(0.1)
        time.sleep(1.0)  # a checkpoint of Stable-Baselines3 takes a moment
        process.send_signal(signal.SIGINT)
        _, errors = process.communicate(timeout=60)
    assert process.returncode != 0 and "interrupt" in errors.lower()
    refused = subprocess.run([sys.executable, *command], capture_output=True, text=True)
    assert refused.returncode == 2 and "holds a training to resume" in refused.stderr
    python(*command, "--resume", "--steps", 200_000)
    steps = "steps" if script == "own_loop" else "time/total_timesteps"
    counts = [int(row[steps]) for path in sorted(folder.glob(curves)) for row in rows(path)]
    assert len(counts) > 1 and len(set(counts[:2])) == 2 and counts[-1] >= 170_000
