import dataclasses
import io
import itertools
import math
from urllib.request import urlopen

import numpy as np
import pytest
import trimesh

import terrainkit as tk
from terrainkit.views.preview import MIN_SHADE, height_colors, shaded_relief
from terrainkit.views.viewer import FIELD_OF_VIEW, camera_position, show_map, triangle_colors


@pytest.fixture
def server(make_viewer_server):
    return make_viewer_server()


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
    arrows = shown["/map/goals"][0]
    assert len(arrows) == (~np.isnan(terrain_map.goals[..., 0])).sum()
    assert arrows[0, 0, :2] == pytest.approx(terrain_map.goals[0, 0, 0, :2], abs=1e-5)
    assert len(shown["/map/spawns"][0]) == 20
    assert shown["/map/labels/terrain_0"][0] == terrain_map.terrain_names[0]
    assert sum(name.startswith("/map/labels/level") for name in shown) == 2


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


@pytest.mark.parametrize("upper", [(80.0, 80.0, 0.0), (8.0, 160.0, 3.0), (160.0, 8.0, 0.0)])
def test_camera_has_a_box_in_view(upper):
    upper = np.array(upper)
    position = camera_position(np.zeros(3), upper)
    corners = np.array(list(itertools.product(*zip(np.zeros(3), upper, strict=True))))
    forward = upper / 2 - position
    forward /= np.linalg.norm(forward)
    right = np.array([1.0, 0.0, 0.0])
    axes = np.stack([right, np.cross(right, forward), forward])
    x, y, depth = axes @ (corners - position).T
    side = np.abs(np.stack([x, y]) / depth).max() / math.tan(FIELD_OF_VIEW / 2)
    assert 0.8 < side < 0.9


def test_labels_are_beside_the_patches(server, shown):
    show_map(server, make_map("legged_gym"))
    labels = {name: call for name, call in shown.items() if "/labels/" in name}
    places = {text: options["position"] for text, options in labels.values()}
    assert places["level 0"] == pytest.approx((4.0, -0.5, 0.0))
    assert places["pyramid_slope_inverted"][0] == -0.5
    assert len(places) == 2 + len(set(make_map("legged_gym").terrain_names))


def test_show_map_without_solids_has_no_solids(server, shown):
    show_map(server, make_map("legged_gym"))
    assert not {"/map/solids", "/map/special_solids", "/map/goals", "/map/goal_order"} & set(shown)


def test_server_answers_in_browser(server):
    show_map(server, make_map("stairs"))
    with urlopen(f"http://localhost:{server.get_port()}", timeout=10) as response:
        assert response.status == 200


def test_names_of_a_map_are_text(server, monkeypatch):
    terrain_map, pages = make_map("stairs"), []
    names = ("`</code><iframe srcdoc='<script>alert(1)</script>'>",) * len(
        terrain_map.terrain_names
    )
    monkeypatch.setattr(server.gui, "add_html", pages.append)
    show_map(server, dataclasses.replace(terrain_map, terrain_names=names))
    assert "&lt;iframe" in pages[0]
    assert "<iframe" not in pages[0]
