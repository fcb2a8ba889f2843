"""Draw the pictures of the docs."""

import dataclasses
import os
import re
import subprocess
import sys
from collections.abc import Callable
from functools import partial
from io import StringIO
from pathlib import Path
from tempfile import TemporaryDirectory

import cv2
import numpy as np
from diagrams import DRAWINGS
from gallery import render_map, render_patches
from numpy.typing import NDArray
from rich.console import Console
from rich.text import Text

import terrainkit
from terrainkit.feasibility import assess_map
from terrainkit.feasibility.report import routes
from terrainkit.map.map_config import MapConfig
from terrainkit.perception import EdgeMap, RayCaster, depth_directions
from terrainkit.terrain import presets, registry
from terrainkit.terrain.paper import get_paper, paper_names
from terrainkit.views.preview import render_preview, write_preview
from terrainkit_robots.description import bundled
from terrainkit_robots.rendering.robot_images import render_robot
from terrainkit_robots.simulation.robot_limits import derive_limits

PICTURES = Path(__file__).parent / "pictures"
SEED = 3


def pictures() -> dict[str, Callable[[], None]]:
    """Return the functions that draw the pictures, by name."""
    return {
        **{name: partial(draw_terrain, name) for name in registry.terrain_names()},
        **{name: partial(draw_paper, name) for name in paper_names()},
        "building": draw_building,
        "map": draw_map,
        "map_3d": draw_map_3d,
        "check_robot": draw_check_robot,
        "feasibility": partial(draw_feasibility, "quadruped"),
        "parkour_course": draw_courses,
        "perception": draw_perception,
        "built_stairs": draw_built_stairs,
        "quadruped": partial(draw_robot, "quadruped"),
        "walk": draw_walk,
        **{name: partial(draw, PICTURES / f"{name}.svg") for name, draw in DRAWINGS.items()},
    }


def draw_map() -> None:
    terrain_map = terrainkit.generate(MapConfig())
    write_preview(terrain_map, PICTURES / "map.png", width=820, overwrite=True)


def draw_map_3d() -> None:
    terrain_map = terrainkit.generate(MapConfig(border=1.0))
    write_picture("map_3d", render_map(terrain_map, width=1000))


def write_picture(name: str, picture: NDArray[np.uint8]) -> None:
    bgr = cv2.cvtColor(picture, cv2.COLOR_RGB2BGR)
    cv2.imwrite(str(PICTURES / f"{name}.png"), bgr, [cv2.IMWRITE_PNG_COMPRESSION, 9])


def draw_terrain(name: str) -> None:
    """Render patches of a terrain at difficulty 0.1, 0.5 and 1."""
    terrain = terrainkit.SubTerrain(terrain=name)
    draw_patches(name, [(terrain, difficulty) for difficulty in (0.1, 0.5, 1.0)])


def draw_building() -> None:
    """Render a building cut off above the ground floor and above the next floor, and whole."""
    building = terrainkit.SubTerrain(terrain="building")
    storey = building.at(1.0).floors(MapConfig().patch_grid(0, 0))[1]
    draw_patches("building", [(building, 1.0)] * 3, cuts=(1.2, storey + 1.2, np.inf))


def draw_built_stairs() -> None:
    shapes = {"residential": 2, "public": 1, "industrial": 2, "fire_escape": 1}
    stairs = [presets.get_preset(name)[k] for name, k in shapes.items()]
    draw_patches("built_stairs", [(patch, 1.0) for patch in stairs])


def draw_patches(
    name: str,
    terrains: list[tuple[terrainkit.SubTerrain, float]],
    cuts: tuple[float, ...] = (),
) -> None:
    """Render a patch of each terrain with its difficulty; see `render_patches`."""
    patches = [
        terrainkit.make_patch(
            MapConfig(
                rows=1,
                cols=1,
                border=0,
                seed=SEED,
                mode="selected",
                selected_difficulty=difficulty,
                terrains=(terrain,),
            ),
            0,
            0,
        )
        for terrain, difficulty in terrains
    ]
    write_picture(name, render_patches(patches, width=800, cuts=cuts))


def draw_paper(name: str) -> None:
    """Render each terrain of a work once, on patches as in the work."""
    paper = get_paper(name)
    terrains = tuple(dataclasses.replace(terrain, proportion=1.0) for terrain in paper.terrains)
    size = {"rows": 3, "cols": len(terrains), "border": 1.0, "seed": SEED}
    config = MapConfig(**{**paper.map, **size}, terrains=terrains)
    write_picture(name, render_preview(terrainkit.generate(config), width=820))


def draw_courses() -> None:
    courses = MapConfig(preset="parkour_course", rows=4, patch_size=(18, 4), border=1, seed=SEED)
    picture = PICTURES / "parkour_course.png"
    write_preview(terrainkit.generate(courses), picture, width=820, overwrite=True)


def draw_perception() -> None:
    """Draw a depth image of stairs, and the edges of the patch with a foothold mask."""
    stairs = terrainkit.SubTerrain(terrain="pyramid_stairs", parameters={"inverted": True})
    terrain_map = terrainkit.generate(
        MapConfig(rows=1, cols=1, border=0, mode="selected", terrains=(stairs,))
    )
    eye, down = terrain_map.env_origins[:, 0] + [0.0, 0.0, 0.5], np.radians(6)
    camera = depth_directions(480, 360, 1.4)
    quat = [[np.cos(down / 2), 0, np.sin(down / 2), 0]]
    depth = RayCaster(terrain_map).sense(eye, quat, camera)[0] * camera[..., 0]
    x, y = np.meshgrid(np.linspace(8, 4, 360), np.linspace(6.4, 1.6, 432), indexing="ij")
    edges = EdgeMap(terrain_map)
    xy = np.stack([x, y], axis=-1)
    views = []
    for values in (1 / depth, edges.distance(xy)):
        shown = cv2.normalize(values, None, 0, 255, cv2.NORM_MINMAX).astype(np.uint8)
        views.append(cv2.applyColorMap(shown, cv2.COLORMAP_VIRIDIS))
    views[1][~edges.is_foothold(xy, 0.03)] = (60, 60, 220)
    column = np.linspace(-0.7, 0.7, 480)  # the tangent of the angle is linear
    azimuth = np.degrees(np.arctan(np.tan(0.7) * column / 0.7))
    elevation = np.degrees(np.arctan(np.tan(0.7) * np.linspace(0.75, -0.75, 360))) - 6
    near, far = float(depth.min()), float(depth[np.isfinite(depth)].max())
    views[0] = with_axes(
        views[0],
        f"depth: {near:.1f} m (yellow) to {far:.0f} m, none (violet)",
        ("angle to the left [deg]", -azimuth, (40, 20, 0, -20, -40)),
        ("elevation [deg]", elevation, (20, 0, -20, -40)),
    )
    views[1] = with_axes(
        views[1],
        f"distance to an edge: 0 to {edges.distance(xy).max():.1f} m (yellow); red: no foothold",
        ("y [m]", y[0], (6, 5, 4, 3, 2)),
        ("x [m]", x[:, 0], (8, 7, 6, 5, 4)),
    )
    cv2.imwrite(str(PICTURES / "perception.png"), np.hstack(views))


def with_axes(
    picture: NDArray[np.uint8],
    title: str,
    across: tuple[str, NDArray[np.float64], tuple[float, ...]],
    down: tuple[str, NDArray[np.float64], tuple[float, ...]],
) -> NDArray[np.uint8]:
    """Return a picture with a title, and axes to the left and below.

    Args:
        picture: The picture, shape (height, width, 3).
        title: Text above it.
        across: Label of the horizontal axis, its value in each column, and its ticks.
        down: Label of the vertical axis, its value in each row, and its ticks.
    """
    left, above, below = 50, 50, 44
    height, width = picture.shape[:2]
    size = ((above, below), (left, 12), (0, 0))
    framed = np.pad(picture, size, constant_values=255)

    def write(text: str, x: int, y: int) -> None:
        cv2.putText(
            framed, text, (x, y), cv2.FONT_HERSHEY_SIMPLEX, 0.42, (40, 40, 40), 1, cv2.LINE_AA
        )

    write(title, left, 16)
    label, values, ticks = down
    write(label, 4, above - 10)
    for tick in ticks:
        row = above + int(np.abs(values - tick).argmin())
        cv2.line(framed, (left - 5, row), (left, row), (40, 40, 40))
        write(f"{tick:g}", 8, min(row + 5, above + height))
    label, values, ticks = across
    write(label, left + width // 2 - 60, above + height + 36)
    for tick in ticks:
        column = left + int(np.abs(values - tick).argmin())
        cv2.line(framed, (column, above + height), (column, above + height + 5), (40, 40, 40))
        write(f"{tick:g}", column - 8, above + height + 20)
    return framed


def draw_robot(name: str) -> None:
    found = bundled.urdf_path(name)
    assert found is not None
    views = dict(render_robot(found.with_suffix(".xml"), size=(400, 340))).values()
    pictures = [cv2.imdecode(np.frombuffer(png, np.uint8), cv2.IMREAD_COLOR) for png in views]
    cv2.imwrite(str(PICTURES / f"{name}.png"), np.hstack(pictures))


def draw_check_robot() -> None:
    """Draw a terminal in which check-robot finds two mistakes in a file and fixes them."""
    found = bundled.urdf_path("quadruped")
    assert found is not None
    text = found.read_text().replace('axis xyz="0 1 0"', 'axis xyz="0 2 0"', 1)
    console = Console(record=True, width=100, file=StringIO())
    with TemporaryDirectory() as folder:
        (Path(folder) / "my_robot.urdf").write_text(text.replace('izz="3.29e-05"', 'izz="0.03"', 1))
        for options in ("", " --unsafe-fixes"):
            command = f"check-robot my_robot.urdf{options}"
            console.print(f"[bold]$ terrainkit {command}[/]", highlight=False)
            output = terminal_output(command, folder)
            console.print(Text.from_ansi(shortened(output)), end="\n\n")
    svg = console.export_svg(title="terrainkit check-robot", unique_id="check-robot")
    # Without the comment, and the fonts that browsers would load from another host.
    picture = re.sub(r"@font-face \{.*?\}\s*|<!--.*?-->\s*", "", svg, flags=re.DOTALL)
    (PICTURES / "check_robot.svg").write_text(picture)


def terminal_output(command: str, folder: str) -> str:
    """Return what a command of terrainkit prints on a terminal with colors, in a folder."""
    environment = os.environ | {"COLUMNS": "100", "TERM": "xterm-256color"}
    environment["PYTHONPATH"] = os.pathsep.join(sys.path)
    line = f"{sys.executable} -m terrainkit_cli.main {command} 2>/dev/null"
    terminal = ["script", "--quiet", "--command", line, "/dev/null"]  # of util-linux
    done = subprocess.run(terminal, env=environment, cwd=folder, capture_output=True, check=False)
    return done.stdout.decode().replace("\r\n", "\n")


def shortened(report: str) -> str:
    """Return a report without the facts after the legs, and the notes after the first."""
    report = re.sub(r"(legs .*?\n).*?\n\n", r"\1  ...\n\n", report, count=1, flags=re.DOTALL)
    note = r"^\S*note\S* .*\n"
    return re.sub(f"({note})({note})+", r"\1...\n", report, flags=re.MULTILINE)


def draw_feasibility(name: str) -> None:
    found = bundled.urdf_path(name)
    assert found is not None
    terrain_map = terrainkit.generate(MapConfig())
    results = assess_map(terrain_map, derive_limits(found.parent).limits)
    picture = PICTURES / "feasibility.png"
    write_preview(terrain_map, picture, width=820, overwrite=True, routes=routes(results))


def draw_walk() -> None:
    from walk import write_walk  # imports torch

    write_walk(PICTURES / "walk.webp")
