import re
from dataclasses import dataclass

import numpy as np
import pytest

import terrainkit
from terrainkit import TerrainMap
from terrainkit.overlays.mirror import Mirror
from terrainkit.overlays.noise import Noise
from terrainkit.overlays.side_walls import SideWalls
from terrainkit.terrain import Terrain, parameter


@pytest.fixture
def banked(own_registry):  # noqa: ARG001
    """Register a terrain with a parameter of each type."""

    @terrainkit.register_terrain
    @dataclass(frozen=True, kw_only=True)
    class BankedTrack(Terrain):
        """A track with a shoulder."""

        height: float = parameter.height(0.1, 0.4)
        """Height of the shoulder [m]."""

        label: str = parameter.text("a")
        """Name of the track."""

        side: str = parameter.choice("left", "right")
        """Side of the shoulder."""

        color: tuple[float, float, float] = parameter.vector((0.5, 0.5, 0.5))
        """Color as red, green and blue, 0 to 1."""

        def heights(self, grid, rng):  # noqa: ARG002
            shoulder = np.zeros(grid.shape)
            shoulder[:, slice(0, 5) if self.side == "right" else slice(-5, None)] = self.height
            return shoulder

    return BankedTrack


@pytest.mark.usefixtures("banked")
def test_custom_terrain_through_the_command_line(run_main, tmp_path):
    path = tmp_path / "map.npz"
    values = "height=0.1:0.3,label=x:y,side=right,color=[1, 0.5, -1]"
    size = ("--rows", 2, "--cols", 1, "--border", 0)
    run = run_main("generate", "-o", path, "--terrain", "banked_track", "--set", values, *size)
    assert run.returncode == 0, run.stderr
    assert run_main("check-map", path).returncode == 0
    output = run_main("info", path, "--patch", 1, 0).stdout
    rows = [re.split("  +", line)[:2] for line in output.splitlines()]
    for row in (["height", "0.3"], ["label", "x:y"], ["side", "right"], ["color", "[1, 0.5, -1]"]):
        assert row in rows
    terrain_map = TerrainMap.load(path)
    assert terrain_map.parameters[1, 0].requested == {
        "height": 0.3, "label": "x:y", "side": "right", "color": (1.0, 0.5, -1.0),
    }  # fmt: skip
    assert terrain_map.heights.max(axis=0)[[0, -1]].tolist() == [np.float32(0.3), 0.0]


@pytest.mark.usefixtures("banked")
def test_list_prints_choices_overlays_and_registered_terrains(run_main):
    listed = run_main("list").stdout
    assert "registered: banked_track" in listed
    assert "  side_walls  " in listed
    noise = run_main("list", "noise").stdout
    assert noise.startswith("noise: Random heights that are added to the ground.")
    output = run_main("list", "banked_track").stdout
    assert "Side of the shoulder. One of: left, right." in output
    assert "[0.5, 0.5, 0.5]" in output


@pytest.mark.usefixtures("banked")
@pytest.mark.parametrize(
    ("values", "message"),
    [
        ("color=[1,2", "--set: got '2'; expected name=value or name=easy:hard"),
        ("color=[1", "banked_track.color: got '[1'; expected 3 values"),
        ("color=1]", "banked_track.color: got '1]'; expected 3 values"),
        ("height", "--set: got 'height'; expected name=value"),
    ],
)
def test_set_rejects_invalid_value(rejected, values, message):
    words = ("generate", "-o", "a.npz", "--terrain", "banked_track", "--set", values)
    assert message in rejected(*words)


def test_generate_adds_overlays_to_all_terrains(run_main, tmp_path):
    path = tmp_path / "map.npz"
    overlays = ("--overlay", "side_walls:probability=1,height=2", "noise:amplitude=0:0.1", "mirror")
    size = ("--rows", 2, "--cols", 9, "--border", 0)
    run = run_main("generate", "-o", path, *size, *overlays)
    assert run.returncode == 0, run.stderr
    config = TerrainMap.load(path).config
    assert len(config.terrains) == 9
    expected = (SideWalls(probability=1.0, height=2.0), Noise(amplitude=(0.0, 0.1)), Mirror())
    assert {each.overlays for each in config.terrains} == {expected}


@pytest.mark.parametrize(
    ("overlay", "message"),
    [
        ("nois", "or terrainkit.register_overlay; did you mean 'noise'? terrainkit list"),
        ("noise:amplitude", "--overlay: got 'amplitude'; expected name=value"),
    ],
)
def test_overlay_rejects_invalid_value(rejected, overlay, message):
    assert message in rejected("generate", "-o", "a.npz", "--overlay", overlay)
