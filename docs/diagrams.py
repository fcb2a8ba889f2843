"""Drawings of the documentation: axes, walls, an import, legs, steps, errors and velocities."""

import re
from pathlib import Path
from tempfile import TemporaryDirectory

import mujoco
import numpy as np
import trimesh
from svg_drawing import BLUE, GRAY, GREEN, INK, ORANGE, PALE, RED, Drawing

import terrainkit
from terrainkit.terrain.sub_terrain import SubTerrain
from terrainkit_robots.description import bundled
from terrainkit_robots.spec.robot_spec import RobotSpec

RESULTS = Path(__file__).parents[1] / "benchmarks" / "results"

SHADES = ("#cfe0d3", "#efe0b9", "#e9bfa0")
"""Colors of three levels."""


def draw_axes(path: Path) -> None:
    """Draw the grid of patches with the axes, and the samples of a patch."""
    picture = Drawing(820, 360)
    picture.set_scale((56, -56), (110, 290))  # units are half a patch
    picture.box((-0.6, -0.6), (6.6, 4.6), PALE, GRAY)
    for row in range(3):
        for col in range(2):
            low = (2 * row, 2 * col)
            picture.box(low, (2 * row + 2, 2 * col + 2), SHADES[row], INK)
            picture.text((2 * row + 1, 2 * col + 1), f"({row}, {col})", anchor="middle")
    picture.text((3, 4.2), "border", GRAY, anchor="middle")
    picture.dot((0, 0), 4, RED)
    picture.text((0.1, 0.15), "world (0, 0)", RED, 12)
    for point, name, anchor, shift in (
        ((-0.6, -0.6), "lower", "end", -0.1),
        ((6.6, 4.6), "upper", "start", 0.1),
    ):
        picture.dot(point, 4, BLUE)
        picture.text((point[0] + shift, point[1] - 0.08), name, BLUE, 12, anchor)
    picture.arrow((-0.6, -0.9), (6.6, -0.9))
    picture.text((3, -1.2), "x, first index: rows, difficulty 0 to 1", anchor="middle")
    picture.arrow((-0.9, -0.3), (-0.9, 4.6))
    picture.text((-1.2, 4.8), "y, second index: columns, terrain types")
    picture.set_scale((34, -34), (610, 260))  # units are cells
    picture.box((0, 0), (5, 5), SHADES[0], INK)
    for k in range(5):
        picture.line([(k, 0), (k, 5)], GRAY, 0.7)
        picture.line([(0, k), (5, k)], GRAY, 0.7)
        for j in range(5):
            picture.dot((k + 0.5, j + 0.5), 2.5, INK)
    picture.dot((2.5, 1.5), 5, RED)
    picture.text((0, 5.4), "cells of a patch", GRAY)
    picture.text((0, -0.6), "heights[2, 1]: the center", RED)
    picture.text((0, -1.1), "of a cell", RED)
    picture.write(path)


def draw_walls(path: Path) -> None:
    """Draw a section of the surface of a map, and of MuJoCo's heightfield of it."""
    size = {"rows": 1, "cols": 1, "border": 0, "patch_size": (4.0, 4.0)}
    flat = terrainkit.generate(terrainkit.MapConfig(**size, terrains=(SubTerrain(terrain="flat"),)))
    heights = flat.heights.copy()
    heights[29:] = 0.05
    heights[31:] = 0.25
    heights[35:] = -0.3
    heights[38:] = 0.0
    terrain_map = flat.edited(heights=heights)
    samples = 0.05 + 0.1 * np.arange(27, 40)
    fine = np.linspace(2.7, 3.98, 641)
    surface = terrain_map.height(np.column_stack([fine, np.full_like(fine, 2.0)]))
    slopes = np.interp(fine, samples, heights[27:, 20])
    picture = Drawing(820, 330)
    for row, (title, values) in enumerate(
        (("surface: mesh, boxes, height(xy)", surface), ("MuJoCo heightfield", slopes))
    ):
        picture.set_scale((600, -200), (-1594, 80 + 160 * row))
        outline = list(zip(fine, values, strict=True))
        picture.polygon([(fine[0], -0.4), *outline, (fine[-1], -0.4)], PALE)
        picture.line(outline, BLUE, 2.5)
        for x, z in zip(samples, heights[27:, 20], strict=True):
            picture.dot((x, z), 3, INK)
        picture.text((2.72, -0.33), title, BLUE)
    picture.set_scale((600, -200), (-1594, 80))
    picture.text((2.83, 0.09), "0.05 m: a ramp", INK, 12)
    picture.text((3.03, 0.32), "0.2 m: a wall, halfway", INK, 12)
    picture.text((3.53, 0.12), "3 cells are 0.3 m wide", INK, 12)
    picture.write(path)


def draw_import(path: Path) -> None:
    """Draw a section of a mesh with a hole and a bar, and of the imported map."""
    strips = (
        [(0, 0), (2, 0), (2, 0.45), (3, 0.45)],
        [(3.7, 0.2), (4.6, 0.2), (6, 0.7), (7, 0.7)],
    )
    bar = ((0.7, 0.9), (1.5, 1.1))
    body = trimesh.creation.box(bounds=[(bar[0][0], 0, bar[0][1]), (bar[1][0], 3, bar[1][1])])
    with TemporaryDirectory() as folder:
        file = Path(folder) / "scan.stl"
        trimesh.util.concatenate([*map(_extruded, strips), body]).export(file)
        options = terrainkit.ImportOptions(solids=True, spawn_radius=0.3)
        imported = terrainkit.import_map(file, options).terrain_map
    fine = np.linspace(0.002, 6.998, 1000)
    ground = imported.height(np.column_stack([fine, np.full_like(fine, 1.5)]))
    picture = Drawing(820, 400)
    for row, title in enumerate(("the file", "the map: --solids, cells of 0.1 m")):
        picture.set_scale((105, -80), (45, 140 + 190 * row))
        picture.text((0, 1.35), title, BLUE, 14)
        if row == 0:
            for strip in strips:
                picture.line(strip, BLUE, 2.5)
            picture.box(*bar, "none", BLUE)
            picture.text((3.35, 0.1), "no ground", INK, 12, "middle")
            picture.text((1.6, 1.0), "a closed body", INK, 12)
            continue
        outline = list(zip(fine, np.maximum(ground, -0.55), strict=True))
        picture.polygon([(fine[0], -0.6), *outline, (fine[-1], -0.6)], PALE)
        picture.line(outline, BLUE, 2.5)
        for low, high in zip(*imported.solids.bounds(), strict=True):
            picture.box(low[::2], high[::2], ORANGE, INK)
        depth = strips[1][0][1] - ground.min()
        picture.text((3.35, 0.62), f"a hole, {depth:.3g} m deep", INK, 12, "middle")
        picture.text((1.6, 1.0), "a solid; the ground below it is kept", INK, 12)
        picture.text((2.1, 0.15), "a wall", INK, 12)
        picture.text((5.5, 0.25), "a slope", INK, 12)
    picture.write(path)


def _extruded(line: list[tuple[float, float]]) -> trimesh.Trimesh:
    """Return the surface of a line in x and z that is extruded along y."""
    vertices = [(x, y, z) for x, z in line for y in (0, 3)]
    faces = [
        corners
        for k in range(0, 2 * len(line) - 2, 2)
        for corners in ((k, k + 2, k + 3), (k, k + 3, k + 1))
    ]
    return trimesh.Trimesh(vertices, faces, process=False)


def draw_legs(path: Path) -> None:
    """Draw the legs that onboarding finds on the bundled quadruped, in the standing pose."""
    found = bundled.urdf_path("quadruped")
    assert found is not None
    model = mujoco.MjModel.from_xml_path(str(found.with_suffix(".xml")))
    data = mujoco.MjData(model)
    mujoco.mj_resetDataKeyframe(model, data, 0)
    mujoco.mj_forward(model, data)
    feet = RobotSpec.load(found.with_name("robot.toml")).feet
    picture = Drawing(820, 310)
    for view, (axis, origin, title) in enumerate(
        ((0, 230, "from the right"), (1, 610, "from behind"))
    ):
        sign = 1 if axis == 0 else -1  # y points to the left of the robot
        picture.set_scale((sign * 560, -560), (origin, 260))
        edges = [-0.36 * sign, 0.36 * sign] if axis == 0 else [0.3, -0.3]
        picture.line([(edge, 0) for edge in edges], GRAY)
        picture.text((edges[0], 0.41), title, GRAY)
        hips = np.array([data.xpos[_chain(model, foot)[-1]][[axis, 2]] for foot in feet])
        margin = (0.03, 0.04)
        picture.box(hips.min(axis=0) - margin, hips.max(axis=0) + margin, PALE, INK)
        for foot, color in zip(feet, (BLUE, GREEN, ORANGE, RED), strict=True):
            chain = _chain(model, foot)
            points = [data.xpos[body][[axis, 2]] for body in chain]
            picture.line(points, color, 4)
            for point in points[1:]:
                picture.dot(point, 4, "white", color)
            picture.dot(points[0], 9, color)
            if foot[1 - view] == "R":  # the nearer legs
                picture.text((points[0][0], -0.055), foot, color, 12, "middle")
        center = data.subtree_com[1][[axis, 2]]
        picture.line([center, (center[0], 0)], INK, 1, "4 4")
        picture.dot(center, 6, INK)
        if view == 0:
            picture.text((center[0] - 0.02, center[1]), "center of mass", INK, 12, "end")
    picture.write(path)


def _chain(model: mujoco.MjModel, foot: str) -> list[int]:
    """Return the bodies of a leg, from the foot up to the hip."""
    chain = [model.body(foot).id]
    while model.body_parentid[chain[-1]] > 1:  # the trunk
        chain.append(int(model.body_parentid[chain[-1]]))
    return chain


def draw_steps(path: Path) -> None:
    """Draw the steps from a robot file to a policy, with their files."""
    steps = (
        ("1 check-robot", "findings, fixes", "my_robot.urdf"),
        ("2 onboard", "pose, gains, feet", "my_robot/"),
        ("3 check-task", "what pays?", ""),
        ("4 train", "plane, then map", "run/"),
        ("5 evaluate, play", "errors, falls, video", ""),
        ("6 export", "ONNX, JSON", "policy/"),
    )
    picture = Drawing(820, 120)
    for k, (name, about, file) in enumerate(steps):
        x = 10 + 136 * k
        picture.box((x, 20), (x + 120, 70), SHADES[k // 2], INK)
        picture.text((x + 60, 41), name, INK, 13, "middle")
        picture.text((x + 60, 59), about, GRAY, 11, "middle")
        if k < len(steps) - 1:
            picture.arrow((x + 120, 45), (x + 136, 45))
        if file:
            picture.line([(x + 60, 70), (x + 60, 84)], GRAY, 1)
            picture.text((x + 60, 99), file, BLUE, 13, "middle")
    picture.write(path)


def draw_learning(path: Path) -> None:
    """Draw the velocity error over a training, from the table of benchmarks/results."""
    text = (RESULTS / "policies.md").read_text().partition("| iterations | velocity error")[2]
    row = r"^\| ([\d,]+) \| ([\d.]+) \(.*?\) \| ([\d.]+) \("
    table = [
        (float(iterations.replace(",", "")), float(checkpoint), float(mean))
        for iterations, checkpoint, mean in re.findall(row, text, re.MULTILINE)
    ]
    picture = Drawing(820, 300)
    picture.set_scale((0.13, -1500), (80, 250))
    for error in (0, 0.05, 0.1, 0.15):
        picture.line([(0, error), (4400, error)], PALE if error else INK, 1)
        picture.text((-60, error - 0.003), f"{error:g}", GRAY, 12, "end")
    for iterations in range(0, 4001, 1000):
        picture.text((iterations, -0.012), f"{iterations:,}", GRAY, 12, "middle")
    picture.text((2200, -0.026), "iterations of 3,072 samples", GRAY, 12, "middle")
    picture.text((60, 0.158), "velocity error [m/s]", GRAY, 12)
    for column, color, name in ((1, ORANGE, "checkpoint"), (2, BLUE, "mean of 7 checkpoints")):
        points = [(values[0], values[column]) for values in table]
        picture.line(points, color, 2)
        for point in points:
            picture.dot(point, 4, color)
        picture.text((4260, points[-1][1]), name, color, 12)
    picture.write(path)


def draw_followed(path: Path) -> None:
    """Draw the mean velocity of the bundled quadruped beside each command of the grid."""
    from terrainkit_robots.policy.evaluate import EvaluationConfig, make_eval_env  # imports torch
    from terrainkit_robots.policy.load_policy import load_policy, single_torch_thread
    from terrainkit_robots.policy.policy_rollout import command_schedule, rollout
    from terrainkit_robots.rl.run import open_run

    run = open_run("quadruped")
    settle, seconds = 2.0, 6.0
    with single_torch_thread():
        env, commands = make_eval_env(run, EvaluationConfig(seconds=seconds))
        assert commands is not None
        schedule = command_schedule(commands, round(seconds / env.cfg.dt))
        speeds = [
            env.state.base_lin_vel[:, :2].copy()
            for _ in rollout(env, load_policy(run, env), schedule)
        ]
    reached = np.mean(speeds[round(settle / env.cfg.dt) :], axis=0)
    picture = Drawing(820, 400)
    for panel, yaw in enumerate((-1.0, 0.0, 1.0)):
        picture.set_scale((-140, -140), (145 + 265 * panel, 200))  # left is to the left
        picture.line([(0.62, 0), (-0.62, 0)], PALE)
        picture.line([(0, -1.15), (0, 1.15)], PALE)
        picture.text((0, 1.25), f"yaw rate {yaw:g} rad/s", INK, 13, "middle")
        chosen = np.isclose(commands[:, 2], yaw)
        for command, speed in zip(commands[chosen], reached[chosen], strict=True):
            picture.dot(command[1::-1], 7, "none", GRAY)
            picture.line([command[1::-1], speed[::-1]], BLUE)
            picture.dot(speed[::-1], 3.5, BLUE)
    picture.set_scale()
    picture.dot((30, 385), 7, "none", GRAY)
    picture.text((44, 389), "command: forward is up, left is left; 1 m/s, 0.5 m/s or 0", GRAY, 12)
    picture.dot((420, 385), 3.5, BLUE)
    picture.text((430, 389), "mean velocity of the robot", BLUE, 12)
    picture.write(path)


DRAWINGS = {
    "axes": draw_axes,
    "walls": draw_walls,
    "import_section": draw_import,
    "legs": draw_legs,
    "steps": draw_steps,
    "learning": draw_learning,
    "followed": draw_followed,
}
"""Functions that draw an SVG file, by its name."""
