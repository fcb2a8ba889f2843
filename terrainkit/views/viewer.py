"""An interactive 3D view of a map in the browser, drawn by viser."""

import html
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from terrainkit.geometry.mesh.solid_mesh import concatenate_meshes, solid_meshes
from terrainkit.views.preview import height_colors

if TYPE_CHECKING:
    import viser

    from terrainkit.map.terrain_map import TerrainMap

_SOLID_COLOR = (120, 132, 150)
_HIDDEN_COLOR = (200, 120, 200)
_SPAWN_COLOR = (196, 40, 40)
_GOAL_COLOR = (40, 90, 160)

_ARROW_LENGTH = 0.6
"""Length of the arrows that show headings [m]."""

_ABOVE_GROUND = 0.1
"""Height of markers above the ground [m]."""


def show_map(server: "viser.ViserServer", terrain_map: "TerrainMap") -> None:
    """Add a map to the scene of a viser server, and a checkbox for each of its parts.

    The parts are the ground, colored by height; the solids, and in another color those that are
    not visible to sensors or do not collide; spawn positions and goals with their headings; the
    order of the goals; and the names of the terrains with the levels.
    """
    scene = server.scene
    scene.set_up_direction("+z")
    _add_ground(server, terrain_map)
    parts = {
        "solids": _add_solids(server, terrain_map),
        "spawns": _add_headings(server, "spawns", terrain_map.spawns, _SPAWN_COLOR),
        "goals": [
            *_add_headings(server, "goals", terrain_map.goals, _GOAL_COLOR),
            *_add_goal_order(server, terrain_map),
        ],
        "labels": _add_labels(server, terrain_map),
    }
    server.gui.add_html(f'<code style="margin: 0.5em">{html.escape(repr(terrain_map))}</code>')
    for name, handles in parts.items():
        if handles:
            add_checkbox(server, name, handles)
    config, center = terrain_map.config, np.array([*terrain_map.grid.center, 0.0])
    extent = max(config.rows * config.patch_size[0], config.cols * config.patch_size[1])
    server.initial_camera.look_at = center
    server.initial_camera.position = center + 0.55 * extent * np.array([-1.0, 0.0, 0.8])


def add_checkbox(
    server: "viser.ViserServer", name: str, handles: list[Any], *, initial_value: bool = True
) -> "viser.GuiCheckboxHandle":
    """Add a checkbox that shows and hides a part of the scene, and return it."""
    checkbox = server.gui.add_checkbox(name, initial_value=initial_value)

    def update(_: object) -> None:
        for handle in handles:
            handle.visible = checkbox.value

    checkbox.on_update(update)
    return checkbox


def _add_ground(server: "viser.ViserServer", terrain_map: "TerrainMap") -> None:
    import trimesh

    mesh = terrain_map.ground_mesh()
    colors = height_colors(mesh.vertices[:, 2]).astype(np.uint8)
    ground = trimesh.Trimesh(mesh.vertices, mesh.triangles, vertex_colors=colors, process=False)
    server.scene.add_mesh_trimesh("/ground", ground)


def _add_solids(server: "viser.ViserServer", terrain_map: "TerrainMap") -> list[Any]:
    solids, handles = terrain_map.solids, []
    is_usual = solids.visible & solids.collides
    for name, mask, color in (
        ("/solids", is_usual, _SOLID_COLOR),
        ("/special_solids", ~is_usual, _HIDDEN_COLOR),
    ):
        if mask.any():
            mesh = concatenate_meshes(solid_meshes(solids.select(mask)))
            handles.append(
                server.scene.add_mesh_simple(
                    name, mesh.vertices, mesh.triangles, color=color, flat_shading=True
                )
            )
    return handles


def _add_headings(
    server: "viser.ViserServer",
    name: str,
    positions: NDArray[np.float32],
    color: tuple[int, int, int],
) -> list[Any]:
    """Add an arrow for each position, which has x, y, z [m] and a heading [rad]."""
    flat = positions.reshape(-1, 4)
    flat = flat[~np.isnan(flat).any(axis=1)]
    if not len(flat):
        return []
    heading = flat[:, 3]
    start = flat[:, :3] + [0.0, 0.0, _ABOVE_GROUND]
    direction = np.stack([np.cos(heading), np.sin(heading), np.zeros_like(heading)], axis=1)
    arrows = np.stack([start, start + _ARROW_LENGTH * direction], axis=1)
    return [
        server.scene.add_arrows(
            f"/{name}", arrows, color, shaft_radius=0.03, head_radius=0.08, head_length=0.2
        )
    ]


def _add_goal_order(server: "viser.ViserServer", terrain_map: "TerrainMap") -> list[Any]:
    """Add a line from the spawn origin of each patch through its goals."""
    path = np.concatenate([terrain_map.env_origins[:, :, None], terrain_map.goals[..., :3]], axis=2)
    lines = np.stack([path[:, :, :-1], path[:, :, 1:]], axis=3).reshape(-1, 2, 3)
    lines = lines[~np.isnan(lines).any(axis=(1, 2))] + [0.0, 0.0, _ABOVE_GROUND]
    if not len(lines):
        return []
    return [server.scene.add_line_segments("/goal_order", lines, _GOAL_COLOR, thickness=0.03)]


def _add_labels(server: "viser.ViserServer", terrain_map: "TerrainMap") -> list[Any]:
    """Label the columns of each terrain with its name, and each row with its level."""
    config, (x0, y0) = terrain_map.config, terrain_map.grid.lower
    length, width = config.patch_size
    x, y = x0 + config.border, y0 + config.border
    names = terrain_map.patch_names
    labels = [
        (f"/labels/terrain_{j}", str(names[0, j]), (x - 0.5, y + (j + 0.5) * width, 0.5))
        for j in range(config.cols)
        if j == 0 or names[0, j] != names[0, j - 1]
    ]
    labels += [
        (f"/labels/level_{i}", f"level {i}", (x + (i + 0.5) * length, y - 0.5, 0.5))
        for i in range(config.rows)
    ]
    return [server.scene.add_label(path, text, position=at) for path, text, at in labels]
