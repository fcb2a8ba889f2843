import pytest

from terrainkit import MapConfig, SubTerrain, generate
from terrainkit_robots.policy.patch_dimensions import collision_kind, patch_dimensions
from terrainkit_robots.rl.terrain import MapGround, Plane


@pytest.fixture(scope="module")
def gaps_and_steps():
    gap = SubTerrain(terrain="gap", name="ditch", parameters={"width": (0.0, 0.23)})
    steps = SubTerrain(terrain="pyramid_stairs", parameters={"step_height": (0.1, 0.2)})
    flat = SubTerrain(terrain="flat")
    config = MapConfig(rows=3, cols=3, patch_size=(8.0, 8.0), terrains=(gap, steps, flat))
    return generate(config)


def test_dimensions_are_realized_values_above_0(gaps_and_steps):
    """Gaps are whole cells of 0.1 m: 0, 0.115 and 0.23 m become 0, 0.1 and 0.2 m."""
    found = patch_dimensions(MapGround(gaps_and_steps))
    assert found[:, 0].tolist() == [None, ("ditch", "width", 0.1), ("ditch", "width", 0.2)]
    assert found[:, 1].tolist() == [("pyramid_stairs", "step_height", k) for k in (0.1, 0.15, 0.2)]
    assert found[:, 2].tolist() == [None] * 3
    assert patch_dimensions(Plane()).tolist() == [[None]]


def test_collision_kind_is_the_one_in_use(gaps_and_steps):
    for collision in ("hfield", "boxes"):
        assert collision_kind(MapGround(gaps_and_steps, collision)) == collision
    assert collision_kind(MapGround(gaps_and_steps, "auto")) in ("hfield", "boxes")
    assert collision_kind(Plane()) == "plane"
