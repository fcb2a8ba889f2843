import dataclasses
import os
import re
from pathlib import Path

import mujoco
import numpy as np
import pytest
from scipy.ndimage import binary_dilation

from terrainkit import MapConfig, SubTerrain, generate
from terrainkit.errors import ConfigError
from terrainkit.geometry.walls import wall_edges
from terrainkit.overlays.friction_patches import FrictionPatches

ROOT = Path(__file__).parents[3]
ROBOTS = Path(os.environ.get("TERRAINKIT_ROBOTS", ROOT.parent / "shared" / "robots"))
GO2 = ROBOTS / "go2_mjcf" / "go2.xml"

every_collision = pytest.mark.parametrize("collision", ["hfield", "boxes"])
AROUND = np.ones((3, 3), dtype=bool)
UP = np.array([0.0, 0.0, 1.0])


def loaded(terrain_map, folder, **options):
    path = terrain_map.save(folder / "terrain.xml", **options)
    return mujoco.MjModel.from_xml_path(str(path))


def ray_cast(model, xy):
    data = mujoco.MjData(model)
    mujoco.mj_kinematics(model, data)
    geom = np.zeros(1, dtype=np.int32)
    high = 50.0
    distances = [
        mujoco.mj_ray(model, data, np.array([x, y, high]), -UP, None, 1, -1, geom) for x, y in xy
    ]
    return high - np.array(distances)


def points_in(terrain_map, cells, count=1000):
    grid = terrain_map.grid
    xy = np.random.default_rng(0).uniform(grid.lower, grid.upper, size=(4 * count, 2))
    i, j = ((xy - grid.lower) / grid.cell).astype(int).T
    xy = xy[cells[i, j]][:count]
    assert len(xy) == count
    return xy


def away_from_walls(terrain_map):
    along_x, along_y = wall_edges(terrain_map.heights, terrain_map.config.wall_threshold)
    beside = np.zeros(terrain_map.heights.shape, dtype=bool)
    for side in (slice(None, -1), slice(1, None)):
        beside[side] |= along_x
        beside[:, side] |= along_y
    return ~binary_dilation(beside, AROUND)


@pytest.mark.parametrize("collision", ["hfield", "boxes", "auto"])
def test_mjcf_hfield_matches_away_from_walls(terrain_map, tmp_path, collision):
    model = loaded(terrain_map, tmp_path, collision=collision)
    xy = points_in(terrain_map, away_from_walls(terrain_map))
    np.testing.assert_allclose(ray_cast(model, xy), terrain_map.height(xy), atol=1e-3)


@pytest.mark.parametrize("border", [1.0, "sloped"])
def test_mjcf_hfield_matches_an_edited_border(level_map, tmp_path, border):
    heights = level_map.heights.copy()
    ground = 0.1 * level_map.grid.axis(0)[:, None] if border == "sloped" else border
    heights += np.float32(ground)
    terrain_map = dataclasses.replace(level_map, heights=heights)
    model = loaded(terrain_map, tmp_path, collision="hfield")
    xy = points_in(terrain_map, away_from_walls(terrain_map))
    np.testing.assert_allclose(ray_cast(model, xy), terrain_map.height(xy), atol=1e-3)


@pytest.mark.parametrize("collision", ["boxes", "auto"])
def test_mjcf_boxes_match_up_to_walls(level_map, tmp_path, collision):
    model = loaded(level_map, tmp_path, collision=collision)
    xy = points_in(level_map, np.ones(level_map.heights.shape, dtype=bool))
    np.testing.assert_allclose(ray_cast(model, xy), level_map.height(xy), atol=1e-3)


def test_mjcf_boxes_match_beside_hfield(terrain_map, tmp_path):
    model = loaded(terrain_map, tmp_path, collision="boxes")
    # The heightfield that holds what is not level leans over the cells next to it.
    xy = points_in(terrain_map, ~binary_dilation(~terrain_map.boxes().covered, AROUND))
    np.testing.assert_allclose(ray_cast(model, xy), terrain_map.height(xy), atol=1e-3)


@pytest.mark.parametrize("centered", [False, True])
@pytest.mark.parametrize("border", [0.0, 0.1, 0.2, 0.3, 2.0])
@every_collision
def test_mjcf_ground_extends_to_the_border(tmp_path, border, centered, collision):
    slope = SubTerrain(terrain="slope", parameters={"grade": 0.3, "landing": 1.0})
    pit = SubTerrain(terrain="pit", parameters={"side": 0.5})
    config = MapConfig(
        rows=1,
        cols=2,
        patch_size=(3.0, 2.0),
        border=border,
        centered=centered,
        spawn_radius=0.1,
        terrains=(slope, pit),
    )
    terrain_map = generate(config)
    model = loaded(terrain_map, tmp_path, collision=collision)
    xy = points_in(terrain_map, away_from_walls(terrain_map))
    np.testing.assert_allclose(ray_cast(model, xy), terrain_map.height(xy), atol=1e-3)


def test_mjcf_hfield_rows_are_along_y(terrain_map, tmp_path):
    model = loaded(terrain_map, tmp_path, collision="hfield")
    # 3 patches of 40 cells along y, 2 of 80 along x, and 2 samples of the border on each side.
    assert model.hfield_nrow.tolist() == [3 * 40 + 4]
    assert model.hfield_ncol.tolist() == [2 * 80 + 4]
    half_x, half_y, _, _ = model.hfield_size[0]
    assert [half_x, half_y] == pytest.approx([163 * 0.1 / 2, 123 * 0.1 / 2])


def test_mjcf_auto_uses_complete_boxes(level_map, terrain_map, tmp_path):
    assert loaded(level_map, tmp_path).nhfield == 0
    (tmp_path / "terrain.xml").unlink()
    model = loaded(terrain_map, tmp_path)
    assert model.nhfield == 1
    assert model.ngeom == 1 + 4  # and the border


def test_mjcf_hfields_cover_patches_with_slopes(tmp_path):
    slope = ("pyramid_slope", {"platform": 1.0, "grade": 0.2})
    parts = [slope, ("pit", {"side": 1.0, "depth": 0.5}), slope, slope]
    config = MapConfig(
        rows=1,
        cols=4,
        patch_size=(4.0, 3.0),
        border=1.0,
        spawn_radius=0.1,
        terrains=tuple(
            SubTerrain(terrain=terrain, name=str(k), parameters=given)
            for k, (terrain, given) in enumerate(parts)
        ),
    )
    model = loaded(generate(config), tmp_path, collision="boxes")
    assert model.nhfield == 2
    # Columns 0, and 2 to 3. A part ends one sample beyond its patches, two in the border.
    assert model.hfield_ncol.tolist() == [40 + 4] * 2
    assert model.hfield_nrow.tolist() == [2 + 30 + 1, 1 + 60 + 2]
    y = model.geom_pos[model.geom_type == mujoco.mjtGeom.mjGEOM_HFIELD, 1]
    assert y.tolist() == pytest.approx([(-0.15 + 3.05) / 2, (5.95 + 12.15) / 2])


def test_mjcf_divides_long_heightfields_beside_boxes(tmp_path):
    slope = SubTerrain(terrain="pyramid_slope", parameters={"platform": 1.0, "grade": 0.2})
    pit = SubTerrain(terrain="pit", parameters={"side": 1.0, "depth": 0.5})
    terrain_map = generate(
        MapConfig(
            rows=8,
            cols=2,
            patch_size=(4.0, 4.0),
            border=1.0,
            spawn_radius=0.1,
            terrains=(slope, pit),
        )
    )
    model = loaded(terrain_map, tmp_path, collision="boxes")
    # 32 m and two samples on both sides, in two parts that share a sample: 324 = 162 + 163 - 1.
    assert model.hfield_ncol.tolist() == [162, 163]
    half = model.hfield_size[:, 0]
    x = model.geom_pos[model.geom_type == mujoco.mjtGeom.mjGEOM_HFIELD, 0]
    assert x[0] + half[0] == pytest.approx(x[1] - half[1])
    xy = points_in(terrain_map, away_from_walls(terrain_map))
    np.testing.assert_allclose(ray_cast(model, xy), terrain_map.height(xy), atol=1e-3)


def test_mjcf_hfield_of_the_largest_heights(level_map, tmp_path):
    heights = np.full(level_map.heights.shape, -1e6, np.float32)
    heights[level_map.config.patch_cells(0, 0)] = 1e6
    path = level_map.edited(heights=heights).save(tmp_path / "map.xml", collision="hfield")
    model = mujoco.MjModel.from_xml_path(str(path))
    assert model.hfield_size[0, 2] == pytest.approx(2e6)
    assert sorted({*model.hfield_data.tolist()}) == [0, 1]


def test_mjcf_flat_map_is_one_box(tmp_path):
    flat = generate(MapConfig(rows=2, cols=1, terrains=(SubTerrain(terrain="flat"),)))
    model = loaded(flat, tmp_path)
    assert model.ngeom == 1
    assert ray_cast(model, [(1.0, 2.0), (-24.9, 32.9)]).tolist() == pytest.approx([0.0, 0.0])


def test_mjcf_flat_map_as_hfield(tmp_path):
    flat = generate(MapConfig(rows=1, cols=1, terrains=(SubTerrain(terrain="flat"),)))
    model = loaded(flat, tmp_path, collision="hfield")
    assert ray_cast(model, [(1.0, 2.0), (-24.9, 32.9)]).tolist() == pytest.approx([0.0, 0.0])


@every_collision
def test_mjcf_geoms_belong_to_the_world(terrain_map, tmp_path, collision):
    model = loaded(terrain_map, tmp_path, collision=collision)
    assert model.nbody == 1
    assert model.nv == 0


@every_collision
def test_mjcf_friction_is_from_the_config(terrain_map, tmp_path, collision):
    model = loaded(terrain_map, tmp_path, collision=collision)
    np.testing.assert_allclose(model.geom_friction[:, 0], 0.8)
    contact = [
        model.numeric(f"terrain_{name}").data.item()
        for name in ("static_friction", "dynamic_friction", "restitution")
    ]
    assert contact == [0.8, 0.6, 0.1]


@every_collision
def test_mjcf_is_deterministic(terrain_map, tmp_path, collision):
    again = generate(terrain_map.config)
    first, second = (
        each.save(tmp_path / f"{k}.xml", collision=collision).read_bytes()
        for k, each in enumerate((terrain_map, again))
    )
    assert first == second


def test_mjcf_unknown_collision_lists_options(terrain_map, tmp_path):
    with pytest.raises(ConfigError, match=r"collision: got 'mesh'; .* one of: auto, hfield, boxes"):
        terrain_map.save(tmp_path / "terrain.xml", collision="mesh")
    assert list(tmp_path.iterdir()) == []


ROBOT = """
<mujoco model="robot">
  <compiler angle="degree" meshdir="meshes" texturedir="textures" autolimits="true"/>
  <default>
    <geom contype="4" conaffinity="2" condim="6" friction="0.1 0.2 0.3" priority="1" group="4"
          margin="0.2" gap="0.1" solref="0.5 2" solimp="0.5 0.6 0.1" solmix="7" rgba="1 0 0 1"/>
  </default>
  {before}
  <worldbody>
    <light pos="0 0 9"/>
    <body name="ball" pos="0 0 9">
      <freejoint/>
      <geom name="ball" type="sphere" size="0.1" mass="1" contype="1" conaffinity="1" condim="3"
            priority="0" margin="0" gap="0" solref="0.02 1" solimp="0.9 0.95 0.001"/>
    </body>
  </worldbody>
  {after}
</mujoco>
"""
INCLUDE = '<include file="terrain.xml"/>'


@pytest.fixture(params=["before", "after"])
def scene_with_ball(request):
    places = {"before": "", "after": ""} | {request.param: INCLUDE}
    return ROBOT.format(**places)


def include(scene, terrain_map, folder, collision):
    terrain_map.save(folder / "terrain.xml", collision=collision)
    (folder / "scene.xml").write_text(scene)
    return mujoco.MjModel.from_xml_path(str(folder / "scene.xml"))


@every_collision
def test_mjcf_ignores_defaults_of_a_robot(scene_with_ball, terrain_map, tmp_path, collision):
    model = include(scene_with_ball, terrain_map, tmp_path, collision)
    alone = mujoco.MjModel.from_xml_path(str(tmp_path / "terrain.xml"))
    ground = np.flatnonzero(model.geom_bodyid == 0)
    assert len(ground) == alone.ngeom == model.ngeom - 1
    names = "pos size contype conaffinity condim priority friction solmix solref solimp margin gap"
    for name in (*names.split(), "group", "rgba"):
        found, wanted = (getattr(each, f"geom_{name}") for each in (model, alone))
        assert found[ground].tolist() == wanted.tolist()


@every_collision
def test_mjcf_ball_rests_at_spawn_origin(scene_with_ball, terrain_map, tmp_path, collision):
    model = include(scene_with_ball, terrain_map, tmp_path, collision)
    data = mujoco.MjData(model)
    for origin in terrain_map.env_origins.reshape(-1, 3).astype(float):
        mujoco.mj_resetData(model, data)
        data.qpos[:3] = origin + 0.3 * UP
        mujoco.mj_step(model, data, nstep=700)
        assert data.ncon > 0
        assert np.abs(data.qvel).max() < 0.01
        np.testing.assert_allclose(data.qpos[:3], origin + 0.1 * UP, atol=2e-3)


TETRAHEDRON = "v 0 0 0\nv 1 0 0\nv 0 1 0\nv 0 0 1\nf 1 3 2\nf 1 2 4\nf 1 4 3\nf 2 3 4\n"


@pytest.mark.skipif(not GO2.is_file(), reason=f"no {GO2}; TERRAINKIT_ROBOTS says where robots are")
@every_collision
def test_mjcf_robot_rests_at_spawn_origin(terrain_map, tmp_path, collision):
    # Its meshes are only to look at, and one is missing: any will do.
    (tmp_path / "assets").mkdir()
    for name in re.findall(r'file="(\w+\.obj)"', GO2.read_text()):
        (tmp_path / "assets" / name).write_text(TETRAHEDRON)
    scene = f'<mujoco><include file="{GO2.resolve()}"/>{INCLUDE}</mujoco>'
    model = include(scene, terrain_map, tmp_path, collision)
    data = mujoco.MjData(model)
    for origin in terrain_map.env_origins.reshape(-1, 3).astype(float):
        mujoco.mj_resetDataKeyframe(model, data, 0)
        data.qpos[:3] = origin + 0.3 * UP
        mujoco.mj_step(model, data, nstep=1000)
        # Its motors are off, so it lies on its belly.
        base = data.qpos[:3] - origin
        assert np.abs(data.qvel[:6]).max() < 0.05
        assert np.abs(base[:2]).max() < 0.05
        assert 0.05 < base[2] < 0.15
        on_ground = (model.geom_bodyid[data.contact.geom] == 0).any(axis=1)
        assert on_ground.sum() >= 3
        assert data.contact.dist[on_ground].min() > -5e-3


@pytest.mark.parametrize("collision", ["hfield", "boxes", "auto"])
def test_mjcf_has_one_geom_per_solid(solid_map, tmp_path, collision):
    model = loaded(solid_map, tmp_path, collision=collision)
    kinds = [int(kind) for kind in model.geom_type[-4:]]
    geom = mujoco.mjtGeom
    assert kinds == [geom.mjGEOM_BOX, geom.mjGEOM_BOX, geom.mjGEOM_CYLINDER, geom.mjGEOM_MESH]
    assert model.geom_friction[-4:, 0].tolist() == [0.3, 1.0, 1.0, 1.0]
    assert model.geom_contype[-4:].tolist() == [1, 0, 1, 1]
    assert model.geom_conaffinity[-4:].tolist() == [1, 0, 1, 1]
    assert model.geom_group[-4:].tolist() == [0, 0, 3, 0]


def test_mjcf_rays_hit_the_solids(solid_map, tmp_path):
    model = loaded(solid_map, tmp_path)
    xy = np.array([[1, 6], [5, 6], [2, 6], [4.1, 6.1], [3, 6]])
    assert ray_cast(model, xy) == pytest.approx([0.6, 0.6, 0.7, 0.4, 0.0], abs=1e-6)


def test_mjcf_ball_lands_on_the_first_solid_that_collides(solid_map, tmp_path):
    path = solid_map.save(tmp_path / "ground.xml")
    spec = mujoco.MjSpec.from_file(str(path))
    for x in (1.0, 5.0):  # over the box, and over the box that does not collide
        ball = spec.worldbody.add_body(pos=[x, 6.0, 1.5])
        ball.add_freejoint()
        ball.add_geom(type=mujoco.mjtGeom.mjGEOM_SPHERE, size=[0.05, 0, 0], mass=1)
    model = spec.compile()
    data = mujoco.MjData(model)
    mujoco.mj_step(model, data, 1500)
    assert data.xpos[-2:, 2] == pytest.approx([0.65, 0.05], abs=2e-3)


# ---- friction ----------------------------------------------------------------------------------


def friction_map(terrain, overlays=(), **rest):
    """Return a map whose second column has its own friction, and a third one overlays."""
    terrains = (
        SubTerrain(terrain=terrain, name="plain"),
        SubTerrain(terrain=terrain, name="icy", friction=(0.5, 0.25)),
        SubTerrain(terrain=terrain, name="patchy", overlays=overlays),
    )
    size = {"rows": 2, "cols": 3, "patch_size": (6.0, 4.0), "border": 1.0, "seed": 3}
    return generate(MapConfig(terrains=terrains, static_friction=0.8, **size | rest))


def friction_below(model, xy):
    """Return the friction of the highest geom at each point."""
    data, geom = mujoco.MjData(model), np.zeros(1, dtype=np.int32)
    mujoco.mj_forward(model, data)
    found = []
    for x, y in xy:
        mujoco.mj_ray(model, data, [x, y, 20.0], [0, 0, -1], None, 1, -1, geom, None)
        found.append(model.geom_friction[geom[0], 0])
    return np.array(found)


@pytest.mark.parametrize(
    ("terrain", "overlays"),
    [("flat", FrictionPatches()), ("stairs", FrictionPatches()), ("rough", FrictionPatches())],
)
@pytest.mark.parametrize("collision", ["hfield", "boxes", "auto"])
def test_mjcf_has_friction_of_each_cell(tmp_path, terrain, overlays, collision):
    terrain_map = friction_map(terrain, (overlays,))
    model = loaded(terrain_map, tmp_path, collision=collision)
    cells = np.random.default_rng(0).integers(0, terrain_map.heights.shape, (1000, 2))
    # A heightfield ends at a sample, half a cell beyond the edge.
    friction = np.pad(terrain_map.friction, 1, mode="edge")
    block = np.array([friction[i : i + 3, j : j + 3] for i, j in cells])
    cells = cells[(block == block[:, 1:2, 1:2]).all(axis=(1, 2))]
    xy = terrain_map.first_sample + (cells + 0.1) * terrain_map.grid.cell
    expected = terrain_map.friction[tuple(cells.T)]
    assert friction_below(model, xy) == pytest.approx(expected, abs=1e-6)
    assert len(np.unique(expected)) > 10


@every_collision
def test_mjcf_with_several_frictions_has_the_same_ground(tmp_path, collision):
    terrain_map = friction_map("rough_slope", (FrictionPatches(),))
    cells = points_in(terrain_map, np.ones(terrain_map.heights.shape, dtype=bool))
    uniform = np.broadcast_to(np.float32(0.8), terrain_map.friction.shape)
    plain = dataclasses.replace(terrain_map, friction=uniform)
    expected = ray_cast(loaded(plain, tmp_path, collision=collision), cells)
    found = ray_cast(loaded(terrain_map, tmp_path, collision=collision, overwrite=True), cells)
    assert found == pytest.approx(expected, abs=2e-4)


def test_mjcf_boxes_have_exact_friction_edges(tmp_path):
    terrain_map = friction_map("flat", (FrictionPatches(),))
    model = loaded(terrain_map, tmp_path, collision="boxes")
    assert model.nhfield == 0
    cells = np.random.default_rng(0).integers(0, terrain_map.heights.shape, (1000, 2))
    xy = terrain_map.first_sample + (cells + 0.45) * terrain_map.grid.cell
    expected = terrain_map.friction[tuple(cells.T)]
    assert friction_below(model, xy) == pytest.approx(expected, abs=1e-6)


def test_mjcf_auto_uses_boxes_for_level_friction_patches(tmp_path):
    terrain_map = friction_map("flat", (FrictionPatches(side=0.3),), cols=9)
    model = loaded(terrain_map, tmp_path)
    assert model.nhfield == 0
    assert model.ngeom > 200


def test_mjcf_one_friction_per_patch_splits_the_heightfield(tmp_path):
    model = loaded(friction_map("rough", rows=1, seed=0), tmp_path, collision="hfield")
    # Border and two plain columns: four rectangles around the icy patch and the patch itself.
    own = model.geom_friction[:, 0] == 0.5
    assert own.sum() == 1
    assert model.geom_priority[own].tolist() == [2]
    assert (model.geom_priority[~own] == 0).all()
    assert model.nhfield <= 5


def test_mjcf_slippery_patch_lets_a_box_slide(tmp_path):
    """A box on a slope of 0.3 slides where the friction is 0.1, and stays where it is 0.8."""
    slope = {"terrain": "pyramid_slope", "parameters": {"grade": 0.3, "platform": 2.0}}
    terrains = (SubTerrain(**slope), SubTerrain(**slope, name="icy", friction=0.1))
    config = MapConfig(rows=1, cols=2, border=1.0, static_friction=0.8, terrains=terrains)
    terrain_map = generate(config)
    spec = mujoco.MjSpec.from_file(str(terrain_map.save(tmp_path / "map.xml")))
    for col in (0, 1):
        x, y = config.patch_grid(0, col).center
        start = [x - 2.0, y, float(terrain_map.height((x - 2.0, y))) + 0.12]
        body = spec.worldbody.add_body(pos=start)
        body.add_freejoint()
        body.add_geom(type=mujoco.mjtGeom.mjGEOM_BOX, size=[0.1, 0.1, 0.05], priority=1)
    model = spec.compile()
    data = mujoco.MjData(model)
    mujoco.mj_forward(model, data)
    start = data.xpos[1:, 0].copy()
    while data.time < 1.0:
        mujoco.mj_step(model, data)
    slid = start - data.xpos[1:, 0]
    assert abs(slid[0]) < 0.1
    assert slid[1] > 0.4


def test_mjcf_has_a_site_per_goal(solid_map, tmp_path):
    model = loaded(solid_map, tmp_path)
    data = mujoco.MjData(model)
    mujoco.mj_kinematics(model, data)
    names = [model.site(k).name for k in range(model.nsite)]
    assert names == ["goal_0_1_0", "goal_0_1_1"]
    goals = solid_map.goals[0, 1]
    assert data.site_xpos == pytest.approx(goals[:, :3], abs=1e-5)
    forward = data.site_xmat.reshape(-1, 3, 3)[:, :, 0]
    heading = np.arctan2(forward[:, 1], forward[:, 0])
    assert heading == pytest.approx(goals[:, 3], abs=1e-5)
