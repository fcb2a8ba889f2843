import dataclasses

import numpy as np
import pytest

from terrainkit import MapConfig, SubTerrain, TerrainMap, generate, make_patch
from terrainkit.geometry.solids import Solids
from terrainkit.map.validate import validate
from terrainkit.overlays.mirror import Mirror
from terrainkit.overlays.noise import Noise
from terrainkit.overlays.rotate import Rotate
from terrainkit.overlays.side_walls import SideWalls
from terrainkit.terrain import registry

TERRAINS = registry.terrain_names()
OVERLAYS = {name: (registry.get_overlay(name)(),) for name in registry.overlay_names()} | {
    "perlin": (Noise(pattern="perlin", spacing=1.0),),
    "walls_everywhere": (SideWalls(probability=1.0),),
    "rotate_270": (Rotate(degrees=270),),
    "all": tuple(registry.get_overlay(name)() for name in registry.overlay_names()),
}
every_terrain = pytest.mark.parametrize("terrain", TERRAINS)
coarse = pytest.mark.filterwarnings("ignore::terrainkit.TerrainkitWarning")


def config_of(terrain, overlays=(), difficulty=1.0, **rest):
    """Return the config of one patch."""
    sub_terrain = SubTerrain(terrain=terrain, overlays=overlays)
    size = {"rows": 1, "cols": 1, "border": 1.0, "seed": 4} | rest
    return MapConfig(
        mode="selected", selected_difficulty=difficulty, terrains=(sub_terrain,), **size
    )


def patch_of(*args, **rest):
    return make_patch(config_of(*args, **rest), 0, 0)


def assert_same_geometry(patch, other):
    assert patch.heights.tobytes() == other.heights.tobytes()
    assert patch.friction.tobytes() == other.friction.tobytes()
    for field in dataclasses.fields(Solids):
        values, expected = (getattr(each.solids, field.name) for each in (patch, other))
        if field.name in ("boxes", "cylinders"):  # q and -q are the same rotation
            assert values[:, :6] == pytest.approx(expected[:, :6], abs=1e-5)
            assert np.abs((values[:, 6:] * expected[:, 6:]).sum(axis=1)) == pytest.approx(1.0)
        else:
            assert values == pytest.approx(expected, abs=1e-5, nan_ok=True)
    for poses, expected in ((patch.goals, other.goals), (patch.spawns, other.spawns)):
        assert poses[:, :3] == pytest.approx(expected[:, :3], abs=1e-5)
        assert np.cos(poses[:, 3] - expected[:, 3]) == pytest.approx(1.0)


@coarse
@every_terrain
def test_every_overlay_on_every_terrain_is_valid(terrain):
    terrains = tuple(
        SubTerrain(terrain=terrain, overlays=overlays, name=name)
        for name, overlays in OVERLAYS.items()
    )
    size = {"rows": 2, "cols": len(terrains), "border": 1.0, "cell": 0.2, "seed": 4}
    terrain_map = generate(MapConfig(terrains=terrains, **size))
    assert terrain_map.terrain_types[0].tolist() == [*range(len(terrains))]
    # The mesh, the spawn origins, and a second build of each patch.
    issues = [issue for issue in validate(terrain_map) if issue.check != "realized"]
    assert [issue for issue in issues if "no flat disk" not in issue.message] == []


X, Y, QUARTER = Mirror(axis="x"), Mirror(axis="y"), Rotate(degrees=90)


@pytest.mark.parametrize(
    ("overlays", "same"),
    [
        pytest.param((SideWalls(probability=0.0), Noise(amplitude=0.0)), (), id="neutral"),
        pytest.param(4 * (QUARTER,), (), id="whole turn"),
        pytest.param(3 * (QUARTER,), (Rotate(degrees=270),), id="three quarters"),
        pytest.param((X, X), (), id="x twice"),
        pytest.param((Y, Y), (), id="y twice"),
        pytest.param((X, Y), (Rotate(degrees=180),), id="both mirrors"),
    ],
)
@every_terrain
def test_overlays_of_every_terrain_are_the_same_as_others(terrain, overlays, same):
    assert_same_geometry(patch_of(terrain, overlays), patch_of(terrain, same))


@pytest.mark.parametrize("name", registry.overlay_names())
def test_every_overlay_round_trips_through_toml_and_npz(name, tmp_path):
    config = config_of("crawl", (registry.get_overlay(name)(),))
    assert MapConfig.from_toml(config.to_toml()) == config
    loaded = TerrainMap.load(generate(config).save(tmp_path / "map.npz"))
    assert loaded.config == config
    assert validate(loaded) == []
    assert set(loaded.parameters[0, 0].requested) >= {
        f"overlays[0].{key}" for key in registry.get_overlay(name)().requested()
    }


def test_overlays_are_applied_in_order():
    walls, turn = SideWalls(probability=1.0), Rotate(degrees=90)
    for overlays, axis in (((walls, turn), 1), ((turn, walls), 0)):
        lower, upper = patch_of("flat", overlays).solids.bounds()
        assert (upper - lower)[:, axis] == pytest.approx(8.0)
