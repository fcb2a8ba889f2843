"""Time of a MuJoCo step on boxes and on a heightfield, relative to a plane.

The bundled quadruped stands on spawn origins all over the map. CPU time is measured, and the
shortest of several alternating runs counts, since other load only adds time.
"""

import time
import warnings
from collections.abc import Iterator

import mujoco
import numpy as np

import terrainkit
from terrainkit_robots.rl.scene import Scene
from terrainkit_robots.rl.tasks import get_task
from terrainkit_robots.rl.terrain import Ground, MapGround, Plane
from terrainkit_robots.spec.robot import Robot

_NUM_PLACES = 20
_NUM_RUNS = 12
_NUM_STEPS = 200
_NUM_ROWS = (1, 2, 4, 8)
_FLAT_TERRAINS = ("pyramid_stairs_inverted", "pyramid_stairs", "stairs", "obstacles", "pit", "gap")
"""Terrains that boxes represent completely."""


def run() -> Iterator[tuple[str, float]]:
    warnings.simplefilter("ignore", terrainkit.TerrainkitWarning)  # cliffs, as expected
    for preset in ("stairs", "legged_gym"):
        terrain_map = terrainkit.generate(terrainkit.MapConfig(preset=preset))
        boxes, hfield = _step_times(terrain_map)
        yield f"{preset}_boxes_over_plane", boxes
        yield f"{preset}_hfield_over_plane", hfield

    counts, costs = [], []
    for rows in _NUM_ROWS:
        terrain_map = _flat_map(rows)
        boxes, hfield = _step_times(terrain_map)
        counts.append(len(terrain_map.boxes().centers))
        costs.append(boxes / hfield)
        yield f"{counts[-1]}_boxes_over_plane", boxes
        yield f"{counts[-1]}_boxes_over_hfield", costs[-1]
    # The cost grows with the number of boxes and with its logarithm.
    slope, offset = np.polyfit(np.log(counts), costs, 1)
    yield "break_even_boxes", float(np.exp((1 - offset) / slope))


def _flat_map(rows: int) -> terrainkit.TerrainMap:
    inverted = "_inverted"
    terrains = tuple(
        terrainkit.SubTerrain(
            terrain=name.removesuffix(inverted),
            name=name,
            parameters={"inverted": True} if name.endswith(inverted) else {},
        )
        for name in _FLAT_TERRAINS
    )
    config = terrainkit.MapConfig(rows=rows, cols=6, terrains=terrains, slope_threshold=0.25)
    return terrainkit.generate(config)


def _step_times(terrain_map: terrainkit.TerrainMap) -> tuple[float, float]:
    """Return the times of a step on boxes and on a heightfield, relative to a plane."""
    terrains = (Plane(), MapGround(terrain_map, "boxes"), MapGround(terrain_map, "hfield"))
    rollouts = [_standing(terrain, terrain_map.env_origins.reshape(-1, 3)) for terrain in terrains]
    times = np.empty((_NUM_RUNS, 3, _NUM_PLACES))
    for k, i, j in np.ndindex(times.shape):
        model, places = rollouts[i]
        start = time.thread_time()
        mujoco.mj_step(model, places[j], nstep=_NUM_STEPS)
        times[k, i, j] = time.thread_time() - start
    plane, boxes, hfield = times.min(axis=0).mean(axis=1)
    return boxes / plane, hfield / plane


def _standing(terrain: Ground, origins: np.ndarray) -> tuple[mujoco.MjModel, list[mujoco.MjData]]:
    """Return the training scene, and states in which the robot stands at some of the origins."""
    spec = get_task("quadruped")
    robot = Robot.load(spec.folder)
    scene = Scene(robot, terrain, spec.task)
    states = []
    for k in np.linspace(0, len(origins) - 1, _NUM_PLACES).astype(int):
        data = mujoco.MjData(scene.model)
        data.qpos[:] = scene.default_qpos
        data.qpos[:3] = 0.0 if isinstance(terrain, Plane) else origins[k]
        data.qpos[2] += 0.35
        data.ctrl[:] = robot.default_pose
        mujoco.mj_step(scene.model, data, nstep=300)
        states.append(data)
    return scene.model, states
