import dataclasses
import io
import itertools
import math

import numpy as np
import pytest
import trimesh

import terrainkit as tk
from terrainkit.viewer.map_scene import FIELD_OF_VIEW, camera_position, show_map, triangle_colors
from terrainkit.views.preview import height_colors, shaded_relief


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


def test_friction_is_hatched_and_explained(server, shown, monkeypatch):
    pages = []
    monkeypatch.setattr(server.gui, "add_html", pages.append)
    icy = tk.SubTerrain(terrain="flat", friction=0.2)
    terrain_map = tk.generate(tk.MapConfig(rows=1, cols=1, border=1.0, terrains=(icy,)))
    show_map(server, terrain_map)
    texture = np.asarray(read_glb(shown["/map/ground"]).visual.material.baseColorTexture)
    is_dark = (texture == (40, 40, 46)).all(axis=-1)
    assert np.diff(np.flatnonzero(is_dark[20, 10:90])).tolist() == [10] * 7
    assert not is_dark[:10].any()  # the border
    assert "hatched: friction 0.20" in pages[0]


def test_slider_cuts_solids_off(server, shown, monkeypatch, solid_map):
    sliders, add = [], server.gui.add_slider

    def record(*words):
        sliders.append(add(*words))
        return sliders[-1]

    monkeypatch.setattr(server.gui, "add_slider", record)
    show_map(server, solid_map)
    for cut, top in ((0.5, 0.5), (0.8, 0.6)):  # the box ends at 0.6 m
        sliders[0].value = cut
        assert read_glb(shown["/map/solids"]).vertices[:, 2].max() == pytest.approx(top)


def test_triangles_are_colored_by_height_and_slope():
    # A level one at 0.4 m, and two steep ones that face the light and the other side.
    level = np.array([[0.0, 0.0, 0.4], [1.0, 0.0, 0.4], [0.0, 1.0, 0.4]])
    steep = np.array([[0.0, 0.0, 0.4], [0.0, 1.0, 0.4], [1.0, 0.0, -0.6]])
    color = height_colors(np.array(0.4))
    colors = triangle_colors(np.stack([level, steep[::-1], steep]))
    # Of the light (-0.55, 0.45, 0.7), with 0.15 of the contrast of the ground.
    east, west = (1 + 0.15 * ((sign * 0.15) / np.sqrt(2) / 0.7 - 1) for sign in (1, -1))
    below = height_colors(np.array(-0.6))  # the lowest corner
    np.testing.assert_allclose(colors, [color, east * below, west * below])
    west = steep * [-1.0, 1.0, 1.0]
    assert (triangle_colors(west[None])[0] > below).all()


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


@pytest.mark.filterwarnings("ignore:cells of 0.1 m:terrainkit.TerrainkitWarning")
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
