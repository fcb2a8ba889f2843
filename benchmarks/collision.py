"""Time of a MuJoCo step on boxes and on a heightfield, relative to a plane.

The bundled quadruped stands on spawn origins all over the map. CPU time is measured, and the
shortest of several alternating runs counts, since other load only adds time. `near_boxes` has only
the boxes near each robot, as in training.
"""

import time
from collections.abc import Iterator

import numpy as np

import terrainkit
from terrainkit.terrain.presets import get_preset
from terrainkit_robots.rl.config import Task
from terrainkit_robots.rl.scene import Scene
from terrainkit_robots.rl.simulation import Simulation
from terrainkit_robots.rl.tasks import get_task
from terrainkit_robots.rl.terrain import Ground, MapGround, Plane
from terrainkit_robots.spec.robot_arrays import Robot

_NUM_PLACES = 20
_NUM_RUNS = 12
_NUM_STEPS = 50
_NUM_ROWS = (1, 2, 4, 8)
_NEAR_LIMITS = {"stairs": 1.8, None: 2.0, "indoor": 2.0, "street": 2.0}
"""Limit of a step with the boxes near each robot, over a plane, by preset."""

_FLAT_TERRAINS = ("pyramid_stairs_inverted", "pyramid_stairs", "stairs", "obstacles", "pit", "gap")
"""Terrains that boxes represent completely."""


def run() -> Iterator[tuple[str, float]]:
    for preset, limit in _NEAR_LIMITS.items():
        terrain_map = terrainkit.generate(terrainkit.MapConfig(preset=preset))
        for name, cost in _step_times(terrain_map).items():
            suffix = f" (at most {limit})" if name == "near_boxes" else ""
            yield f"{preset or 'default_map'}_{name}_over_plane{suffix}", cost

    flat = tuple(terrain for terrain in get_preset("all") if terrain.name in _FLAT_TERRAINS)
    counts, costs = [], []
    for rows in _NUM_ROWS:
        config = terrainkit.MapConfig(rows=rows, cols=6, terrains=flat, slope_threshold=0.25)
        terrain_map = terrainkit.generate(config)
        times = _step_times(terrain_map)
        counts.append(len(terrain_map.boxes().centers))
        costs.append(times["boxes"] / times["hfield"])
        yield f"{counts[-1]}_boxes_over_plane", times["boxes"]
        yield f"{counts[-1]}_boxes_over_hfield", costs[-1]
    # The cost grows with the number of boxes and with its logarithm.
    slope, offset = np.polyfit(np.log(counts), costs, 1)
    yield "break_even_boxes", float(np.exp((1 - offset) / slope))


def _step_times(terrain_map: terrainkit.TerrainMap) -> dict[str, float]:
    """Return the times of a step relative to a plane: all boxes, those near a robot, heights."""
    task = get_task("quadruped").task
    boxes, hfield = (MapGround(terrain_map, kind) for kind in ("boxes", "hfield"))
    grounds = {"plane": Plane(), "boxes": boxes, "near_boxes": boxes, "hfield": hfield}
    origins = terrain_map.env_origins.reshape(-1, 3)
    simulations = {
        name: _standing(task, ground, origins, all_geoms=name == "boxes")
        for name, ground in grounds.items()
    }
    times = dict.fromkeys(simulations, np.inf)
    for _ in range(_NUM_RUNS):
        for name, simulation in simulations.items():
            start = time.thread_time()
            for _ in range(_NUM_STEPS):
                simulation.step(task.control.decimation)
            times[name] = min(times[name], time.thread_time() - start)
    return {name: times[name] / times["plane"] for name in ("boxes", "near_boxes", "hfield")}


def _standing(task: Task, terrain: Ground, origins: np.ndarray, *, all_geoms: bool) -> Simulation:
    """Return simulations in which the robot stands at some of the origins, on one thread."""
    robot = Robot.load(get_task("quadruped").folder)
    scene = Scene(robot, terrain, task, all_geoms=all_geoms)
    simulation = Simulation(scene, _NUM_PLACES, 1)
    qpos = np.tile(scene.default_qpos, (_NUM_PLACES, 1))
    if not terrain.is_plane:
        qpos[:, :3] = origins[np.linspace(0, len(origins) - 1, _NUM_PLACES).astype(int)]
    qpos[:, 2] += 0.35
    simulation.reset(np.arange(_NUM_PLACES), qpos, np.zeros((_NUM_PLACES, scene.model.nv)))
    simulation.ctrl[:] = robot.default_pose
    simulation.step(300)
    return simulation
