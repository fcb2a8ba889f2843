import subprocess
import sys

import pytest

from terrainkit.errors import MemoryLimitError
from terrainkit_robots.rl.config import Env, Runner, Task
from terrainkit_robots.rl.simulation import bytes_per_env, check_env_memory

MEASURED = """
import re, sys
from pathlib import Path
from terrainkit_robots.rl.env import LeggedEnv
from terrainkit_robots.rl.terrain import Plane
from terrainkit_robots.rl.tasks import get_task
from terrainkit_robots.rl.scene import Robot
from terrainkit_robots.rl.runner import LeggedRunner
from terrainkit_robots.rl.config import Algorithm, Env, Runner, Task, Terrain

def peak():
    status = Path("/proc/self/status").read_text()  # ru_maxrss counts who started it, too
    return 1024 * int(re.search(r"VmHWM:\\s*(\\d+) kB", status)[1])

robot, few, many = Robot.load(get_task("quadruped").folder), 64, 1024
terrain = Terrain(measure_heights=sys.argv[1] == "True")
peaks = []
for count in (few, many):
    task = Task(
        env=Env(num_envs=count, num_threads=1),
        terrain=terrain,
        algorithm=Algorithm(num_learning_epochs=1),
        runner=Runner(num_steps_per_env=12),
    )
    LeggedRunner(LeggedEnv(task, robot, Plane())).learn(1)
    peaks.append(peak())
print((peaks[1] - peaks[0]) / (many - few))
"""


@pytest.mark.skipif(sys.platform != "linux", reason="Linux tells the peak of a process")
@pytest.mark.parametrize("scan", [False, True])
def test_the_estimate_is_near_what_is_taken(quadruped, scan):
    run = subprocess.run(
        [sys.executable, "-c", MEASURED, str(scan)],
        env={"PYTHONPATH": ":".join(filter(None, sys.path)), "OMP_NUM_THREADS": "1"},
        capture_output=True,
        text=True,
        timeout=120,
        check=True,
    )
    measured, task = float(run.stdout), Task(runner=Runner(num_steps_per_env=12))
    assert 0.7 < bytes_per_env(task, quadruped, scan=scan, ngeom=50) / measured < 2.0


def test_what_would_fit_is_said(quadruped, monkeypatch):
    monkeypatch.setattr("terrainkit.memory._free_memory", lambda: 1 << 30)
    task = Task(env=Env(num_envs=40_000))
    with pytest.raises(
        MemoryLimitError, match=r"with 40000 environments needs .*; env\.num_envs 5000 would fit"
    ):
        check_env_memory(task, quadruped, scan=False, ngeom=50)
    check_env_memory(Task(env=Env(num_envs=5000)), quadruped, scan=False, ngeom=50)
