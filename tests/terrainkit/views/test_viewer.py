import dataclasses
from urllib.request import urlopen

import numpy as np
import pytest

import terrainkit as tk
from terrainkit.views.viewer import show_map


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
    for kind in ("mesh_trimesh", "mesh_simple", "arrows", "line_segments", "label"):
        add = getattr(server.scene, f"add_{kind}")

        def record(name, *arguments, add=add, **options):
            calls[name] = (*arguments, options)
            return add(name, *arguments, **options)

        monkeypatch.setattr(server.scene, f"add_{kind}", record)
    return calls


def test_show_map_draws_all_parts(server, shown):
    terrain_map = make_map("parkour")
    show_map(server, terrain_map)
    ground, solids = shown["/ground"][0], shown["/solids"]
    np.testing.assert_array_equal(ground.faces, terrain_map.ground_mesh().triangles)
    assert len(np.unique(ground.visual.vertex_colors, axis=0)) > 3
    triangles = len(terrain_map.mesh().triangles) - len(ground.faces)
    assert len(solids[1]) == triangles
    arrows = shown["/goals"][0]
    assert len(arrows) == (~np.isnan(terrain_map.goals[..., 0])).sum()
    assert arrows[0, 0, :2] == pytest.approx(terrain_map.goals[0, 0, 0, :2], abs=1e-5)
    assert len(shown["/spawns"][0]) == 20
    assert shown["/labels/terrain_0"][0] == terrain_map.terrain_names[0]
    assert sum(name.startswith("/labels/level") for name in shown) == 2


def test_show_map_without_solids_has_no_solids(server, shown):
    show_map(server, make_map("legged_gym"))
    assert not {"/solids", "/special_solids", "/goals", "/goal_order"} & set(shown)


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
