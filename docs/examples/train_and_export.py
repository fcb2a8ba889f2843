"""Train a policy for the bundled quadruped on a map, and export it as ONNX.

Install: pip install '.[train]' (in a clone of terrainkit)
Run: python train_and_export.py [ITERATIONS]; the default of 10 only shows the steps.
docs/training.md says how many iterations a robot needs to walk.
"""

import sys
from dataclasses import replace
from pathlib import Path

import numpy as np
import onnxruntime

import terrainkit
from terrainkit_robots.policy.export import export_policy
from terrainkit_robots.rl.run import open_run
from terrainkit_robots.rl.tasks import get_task
from terrainkit_robots.rl.train import train


def print_progress(runner):
    """Print the mean reward of the last episodes, after each iteration."""
    reward = np.mean(runner.logger.rewbuffer or [0.0])
    print(f"iteration {runner.current_learning_iteration}: reward {reward:.2f}")


terrains = tuple(terrainkit.SubTerrain(terrain=name) for name in ("rough", "pyramid_slope"))
terrain_map = terrainkit.generate(terrainkit.MapConfig(rows=5, cols=4, terrains=terrains))
terrain_map.save("ground.npz", overwrite=True)

# A task is a frozen dataclass with a section for each part; replace what you change.
task = get_task("quadruped").task
iterations = int(sys.argv[1]) if sys.argv[1:] else 10
runner = train(
    "quadruped",
    "ground.npz",
    replace(
        task,
        commands=replace(task.commands, lin_vel_x=(-0.5, 1.0)),
        runner=replace(task.runner, max_iterations=iterations),
    ),
    progress_callback=print_progress,
)
print("wrote the run", runner.folder)

folder = Path("policy")
exported = export_policy(open_run(runner.folder), folder, example=True, overwrite=True)
session = onnxruntime.InferenceSession(folder / "policy.onnx")
actions = session.run(None, {"obs": np.zeros((1, exported.num_observations), np.float32)})[0]
print(f"{exported.num_observations} observations, actions of shape {actions.shape}")
print(f"wrote {folder}: {', '.join(sorted(path.name for path in folder.iterdir()))}")
