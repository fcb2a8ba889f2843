import dataclasses
import io
import itertools
import math

import numpy as np
import pytest
import trimesh

import terrainkit as tk
from terrainkit.viewer.map_scene import FIELD_OF_VIEW, camera_position, show_map, triangle_colors
from terrainkit.views.preview import MIN_SHADE, height_colors, shaded_relief


def make_map(preset):
    return tk.generate(
        tk.MapConfig(rows=2, cols=10, patch_size=(8.0, 6.0), border=1.0, preset=preset)
    )


@pytest.fixture
def shown(server, monkeypatch):
    """Names and arguments of what is added to the scene of the server."""
    calls = {}
    for kind in ("glb", "mesh_simple", "arrows", "line_segments", "label"):
        add = getattr(server.scene, f"add_{kind}")

        def record(name, *arguments, add=add, **options):
            calls[name] = (*arguments, options)
            return add(name, *arguments, **options)

        monkeypatch.setattr(server.scene, f"add_{kind}", record)
    return calls


def test_show_map_draws_all_parts(server, shown):
    terrain_map = make_map("parkour")
    show_map(server, terrain_map)
    ground, solids = read_glb(shown["/map/ground"]), read_glb(shown["/map/solids"])
    np.testing.assert_array_equal(ground.faces, terrain_map.ground_mesh().triangles)
    assert len(solids.faces) == len(terrain_map.mesh().triangles) - len(ground.faces)
    for name, places in (("goals", terrain_map.goals), ("spawns", terrain_map.spawns)):
        x, y, z, heading = places[~np.isnan(places[..., 0])].T
        tip = x + 0.6 * np.cos(heading), y + 0.6 * np.sin(heading), z + 0.1
        arrows = np.array([(x, y, z + 0.1), tip]).transpose(2, 0, 1)
        np.testing.assert_allclose(shown[f"/map/{name}"][0], arrows, atol=1e-5)
    # The lines lead from the origin of each patch through its goals.
    lines, goals = shown["/map/goal_order"][0] - [0, 0, 0.1], terrain_map.goals[0, 0, :2, :3]
    np.testing.assert_allclose(lines[0], [terrain_map.env_origins[0, 0], goals[0]], atol=1e-5)
    np.testing.assert_allclose(lines[1], goals, atol=1e-5)
    assert len(lines) == (~np.isnan(terrain_map.goals[..., 0])).sum()


def read_glb(arguments):
    return trimesh.load(io.BytesIO(arguments[0]), file_type="glb", force="mesh", process=False)


def test_ground_has_the_colors_of_the_preview(server, shown):
    terrain_map = make_map("stairs")
    show_map(server, terrain_map)
    ground = read_glb(shown["/map/ground"])
    relief = shaded_relief(terrain_map.heights, terrain_map.grid.cell)
    np.testing.assert_array_equal(np.asarray(ground.visual.material.baseColorTexture), relief)
    u, v = ground.visual.uv.T
    x, y = ((ground.vertices[:, :2] - terrain_map.grid.lower) / terrain_map.grid.size).T
    np.testing.assert_allclose(u, y, atol=1e-6)
    np.testing.assert_allclose(1 - v, x, atol=1e-6)


def test_triangles_are_colored_by_height_and_slope():
    # A level one at 0.4 m, and two steep ones that face the light and the other side.
    level = np.array([[0.0, 0.0, 0.4], [1.0, 0.0, 0.4], [0.0, 1.0, 0.4]])
    steep = np.array([[0.0, 0.0, 0.4], [0.0, 1.0, 0.4], [1.0, 0.0, -0.6]])
    color = height_colors(np.array(0.4))
    colors = triangle_colors(np.stack([level, steep[::-1], steep]))
    np.testing.assert_allclose(colors, [color, MIN_SHADE * color, MIN_SHADE * color])
    west = steep * [-1.0, 1.0, 1.0]
    assert (triangle_colors(west[None])[0] > color).all()


@pytest.mark.parametrize("size", [(80.0, 80.0, 0.0), (8.0, 160.0, 3.0), (160.0, 8.0, 0.0)])
def test_camera_has_a_box_in_view(size):
    lower = np.array([5.0, -3.0, 1.0])
    middle, position = lower + np.array(size) / 2, camera_position(lower, lower + size)
    corners = lower + np.array(list(itertools.product((0, 1), repeat=3))) * size
    # 50 degrees above the horizon; the picture's axes are x, up and the direction of the view.
    down, ahead = math.sin(math.radians(50)), math.cos(math.radians(50))
    assert np.cross(middle - position, [0, ahead, -down]) == pytest.approx(np.zeros(3))
    axes = np.array([[1, 0, 0], [0, down, ahead], [0, ahead, -down]])
    x, y, depth = axes @ (corners - position).T
    side = np.abs(np.stack([x, y]) / depth).max() / math.tan(FIELD_OF_VIEW / 2)
    assert side == pytest.approx(0.85)


def test_labels_are_beside_the_patches_of_a_map_without_solids(server, shown):
    show_map(server, make_map("legged_gym"))
    labels = {name: call for name, call in shown.items() if "/labels/" in name}
    places = {text: options["position"] for text, options in labels.values()}
    level, name = (12.0, -0.5, 0.0), (-0.5, 24.0, 0.0)  # row 1, and columns 3 and 4
    assert places["level 1"] == pytest.approx(level)
    assert places["pyramid_stairs_inverted"] == pytest.approx(name)
    assert len(places) == 2 + 9
    assert not {"/map/solids", "/map/special_solids", "/map/goals", "/map/goal_order"} & set(shown)


def test_names_of_a_map_are_text(server, monkeypatch):
    terrain_map, pages = make_map("stairs"), []
    names = ("`</code><iframe srcdoc='<script>alert(1)</script>'>",) * len(
        terrain_map.terrain_names
    )
    monkeypatch.setattr(server.gui, "add_html", pages.append)
    show_map(server, dataclasses.replace(terrain_map, terrain_names=names))
    assert "&lt;iframe" in pages[0]
    assert "<iframe" not in pages[0]
