import dataclasses
import io
from xml.etree import ElementTree as ET

import mujoco
import numpy as np
import pytest
from scipy.ndimage import binary_dilation

from terrainkit import MapConfig, SubTerrain, generate
from terrainkit.export import mjcf_map
from terrainkit.geometry.walls import wall_edges
from terrainkit.overlays.friction_patches import FrictionPatches
from tests.rays import cast_rays
from tests.tables import read_table
from tests.terrainkit.maps import plot

every_collision = pytest.mark.parametrize("collision", ["hfield", "boxes"])
AROUND = np.ones((3, 3), dtype=bool)
UP = np.array([0.0, 0.0, 1.0])


def written(terrain_map, collision="hfield"):
    file = io.StringIO()
    mjcf_map.write_model(terrain_map, file, collision)
    return ET.fromstring(file.getvalue())


def loaded(terrain_map, folder, **options):
    path = terrain_map.save(folder / "terrain.xml", **options)
    return mujoco.MjModel.from_xml_path(str(path))


def ray_cast(model, xy):
    """Return the height of the highest geom at each point [m], and its friction."""
    heights, geoms = cast_rays(model, np.column_stack([xy, np.full(len(xy), 50.0)]))
    return heights, model.geom_friction[geoms, 0]


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


def assert_same_ground(model, terrain_map, cells=None):
    xy = points_in(terrain_map, away_from_walls(terrain_map) if cells is None else cells)
    np.testing.assert_allclose(ray_cast(model, xy)[0], terrain_map.height(xy), atol=1e-3)


def test_mjcf_sets_every_attribute_of_its_class(terrain_map):
    root = written(terrain_map)
    (geom,), (site,) = root.iterfind("default/default/geom"), root.iterfind("default/default/site")
    assert geom.attrib == read_table(__file__, "mjcf_sets_every_attribute_of_its_class")
    assert site.attrib == {
        "type": "box",
        "size": "0.15 0.03 0.03",
        "group": "0",
        "rgba": "0.2 0.4 0.8 1",
    }
    assert {each.get("name"): each.get("data") for each in root.iterfind("custom/numeric")} == {
        "terrain_static_friction": "0.8",
        "terrain_dynamic_friction": "0.6",
        "terrain_restitution": "0.1",
    }


def test_mjcf_heightfield_by_hand():
    """Units of 0.1 mm above the lowest sample; the first row has the largest y."""
    terrain_map = plot([[0.0, 0.0, 0.0], [0.0, 0.0, 0.05], [0.03] * 3, [-0.02, 0.0, 0.0]])
    root = written(terrain_map)
    (hfield,), (geom,) = root.iterfind("asset/hfield"), root.iterfind("worldbody/geom")
    # Two samples more on each side repeat the edge.
    low, middle, high = (
        [200, 200, 200, y, 500, last, last, last] for y, last in ((200, 0), (200, 200), (700, 200))
    )
    rows = np.array(hfield.attrib.pop("elevation").split(), int).reshape(7, 8).tolist()
    assert rows == [high] * 3 + [middle] + [low] * 3
    size = "0.35 0.3 0.07 1"  # halves of 7 x 6 cells, 0.05 + 0.02 m, and a meter below
    assert hfield.attrib == {"name": "terrain", "nrow": "7", "ncol": "8", "size": size}
    pos = "0.2 0.15 -0.02"
    assert geom.attrib == {"class": "terrain", "type": "hfield", "hfield": "terrain", "pos": pos}
    heights, inner = terrain_map.heights, (slice(3, 6), slice(2, 4))
    part = (slice(0, 8), slice(0, 7))
    assert mjcf_map.hfield_elevation(heights, part)[::-1].tolist() == rows
    assert mjcf_map.hfield_elevation(heights, inner).tolist() == [[200, 500, 0], [200, 500, 200]]
    assert mjcf_map.hfield_size(heights, inner, 0.1) == pytest.approx((0.1, 0.05, 0.05, 1))


def test_mjcf_level_border_is_boxes_around_the_heightfield():
    heights = np.zeros((14, 13))
    heights[6, 6] = -0.02
    (*boxes, _), pos = written(plot(heights, border=0.5)).iterfind("worldbody/geom"), "pos size"
    # The heightfield ends 0.15 m beyond the patch of 0.4 m x 0.3 m; boxes are 1 m deep.
    assert [[each.get(name) for name in pos.split()] for each in boxes] == [
        ["-0.325 0.15 -0.51", "0.175 0.65 0.51"],
        ["0.725 0.15 -0.51", "0.175 0.65 0.51"],
        ["0.2 -0.325 -0.51", "0.35 0.175 0.51"],
        ["0.2 0.625 -0.51", "0.35 0.175 0.51"],
    ]


@pytest.mark.parametrize(
    ("border", "sample", "number"),
    [(0.0, None, 1), (0.1, None, 1), (0.2, None, 5)]
    + [(0.5, sample, 1) for sample in ((0, 5), (-1, 5), (5, 0), (5, -1))],
)
def test_mjcf_narrow_or_uneven_border_belongs_to_the_heightfield(border, sample, number):
    heights = np.zeros(np.round([4 + 20 * border, 3 + 20 * border]).astype(int))
    heights[sample or (2, 2)] = 0.01 if sample else 0.0
    root = written(plot(heights, border))
    assert len(root.findall("worldbody/geom")) == number
    hfield, (nx, ny) = root.find("asset/hfield"), heights.shape if sample else (4, 3)
    assert (hfield.get("ncol"), hfield.get("nrow")) == (f"{nx + 4}", f"{ny + 4}")


def test_mjcf_has_a_geom_per_solid_and_a_site_per_goal(solid_map):
    *_, board, other, post, hull = written(solid_map).iterfind("worldbody/geom")
    assert board.attrib == read_table(__file__, "mjcf_has_a_geom_per_solid_and_a_site_per_goal")
    assert other.attrib.items() >= {("contype", "0"), ("conaffinity", "0"), ("pos", "5 6 0.5")}
    assert post.attrib.items() >= {("size", "0.2 0.4"), ("type", "cylinder"), ("group", "3")}
    assert hull.attrib == {"class": "terrain", "type": "mesh", "mesh": "solid_0"}
    names = ("friction", "priority", "contype", "group")
    assert [each.get(name) for each in (other, post) for name in names] == [
        *(None, None, "0", None),
        *(None, None, None, "3"),
    ]
    sites = [each.attrib for each in written(solid_map).iterfind("worldbody/site")]
    half = "0.877583 0 0 0.479426"  # the cosine and the sine of 0.5
    assert sites == [
        {"name": "goal_0_1_0", "class": "terrain", "pos": "3 6 0", "quat": "1 0 0 0"},
        {"name": "goal_0_1_1", "class": "terrain", "pos": "5.5 6 0", "quat": half},
    ]


@pytest.mark.parametrize(("number", "is_boxes"), [(198, True), (199, False)])
def test_mjcf_auto_uses_up_to_100_boxes(number, is_boxes):
    """Every other row is a box, on one box below."""
    walls = np.zeros((number, 4))
    walls[::2] = 0.5
    assert (mjcf_map.collision_boxes(plot(walls), "auto") is not None) == is_boxes


def test_mjcf_auto_uses_twice_as_many_boxes_as_heightfields():
    terrain_map = plot(np.zeros((106, 4)), static_friction=0.8)
    friction = np.full((106, 4), 0.8, np.float32)
    friction[::2] = 0.3
    striped = dataclasses.replace(terrain_map, friction=friction)
    assert len(mjcf_map.collision_boxes(striped, "auto").centers) == 106


@pytest.mark.parametrize("row", range(11))
def test_mjcf_auto_finds_a_slope_between_any_two_rows(monkeypatch, row):
    monkeypatch.setattr(mjcf_map, "ROWS_PER_BAND", 4)
    heights = np.zeros((12, 4))
    heights[row + 1 :] = 0.05
    assert mjcf_map.collision_boxes(plot(heights), "auto") is None
    assert mjcf_map.collision_boxes(plot(10 * heights), "auto") is not None  # a wall


def course(*terrains, **config):
    """Return a map with a pyramid of slopes (S), a pit (P) or a straight slope (/) per column."""
    parts = {
        "S": ("pyramid_slope", {"platform": 1.0, "grade": 0.2}),
        "P": ("pit", {"side": 0.5, "depth": 0.5}),
        "/": ("slope", {"grade": 0.3, "landing": 1.0}),
    }
    made = tuple(
        SubTerrain(terrain=parts[each][0], name=str(k), parameters=parts[each][1])
        for k, each in enumerate(terrains)
    )
    return generate(MapConfig(cols=len(made), spawn_radius=0.1, terrains=made, **config))


def test_mjcf_hfields_cover_patches_with_slopes():
    terrain_map = course(*"SPSS", rows=1, patch_size=(4.0, 3.0), border=1.0)
    model = mjcf_map.make_model(terrain_map, "boxes")
    spans = [(x.start, x.stop, y.start, y.stop) for (x, y), _ in model.hfields.values()]
    # Columns 0, and 2 to 3. A part ends one sample beyond its patches, two in the border, and
    # counts from two samples before the map.
    assert spans == [(10, 54, 10, 43), (10, 54, 71, 134)]
    y = [each["pos"][1] for each in model.geoms() if each["type"] == "hfield"]
    assert y == pytest.approx([(-0.15 + 3.05) / 2, (5.95 + 12.15) / 2])


def test_mjcf_divides_long_heightfields_beside_boxes(tmp_path):
    terrain_map = course(*"SP", rows=8, patch_size=(4.0, 4.0), border=1.0)
    model = loaded(terrain_map, tmp_path, collision="boxes")
    # 32 m and two samples on both sides, in two parts that share a sample: 324 = 162 + 163 - 1.
    assert model.hfield_ncol.tolist() == [162, 163]
    half = model.hfield_size[:, 0]
    x = model.geom_pos[model.geom_type == mujoco.mjtGeom.mjGEOM_HFIELD, 0]
    assert x[0] + half[0] == pytest.approx(x[1] - half[1])
    assert_same_ground(model, terrain_map)


def test_mjcf_surface_has_boxes_and_the_heightfield_below_them():
    """Samples are lowered where boxes cover all cells around, which those at the slope do not."""
    heights = np.zeros((10, 4))
    heights[4:9], heights[9] = 0.05, 1.0
    surface = mjcf_map.collision_surface(plot(heights), "boxes")
    lowered = [-0.5, -0.5, 0, 0, 0.05, 0.05, -0.5, -0.5, -0.5, -0.5]
    assert surface.heights[:, 1] == pytest.approx(lowered)
    tops = [0, 0, 0, -np.inf, -np.inf, 0.05, 0.05, 0.05, 0.05, 1.0]
    assert surface.box_top[:, 1] == pytest.approx(tops)
    assert mjcf_map.collision_surface(plot(heights), "hfield").box_top is None


@pytest.mark.parametrize(("scan", "heights"), [(False, [0.6, 0, 0.7]), (True, [0.6, 0.6, 0])])
def test_mjcf_surface_has_solids_that_collide_or_are_visible(solid_map, scan, heights):
    """The board, the board that does not collide, and the hidden post."""
    surface = mjcf_map.collision_surface(solid_map, "hfield")
    x, y = np.array([1, 5, 2], np.float32), np.full(3, 6, np.float32)
    assert surface.height(x, y, scan=scan) == pytest.approx(heights)


@pytest.mark.parametrize("collision", ["hfield", "boxes", "auto"])
def test_mjcf_has_the_same_ground_away_from_walls(terrain_map, tmp_path, collision):
    model = loaded(terrain_map, tmp_path, collision=collision)
    assert_same_ground(model, terrain_map)
    assert (model.nbody, model.nv) == (1, 0)
    assert set(model.geom_friction[:, 0]) == {0.8}
    if collision == "boxes":
        # The heightfield that holds what is not level leans over the cells next to it.
        covered = terrain_map.boxes().box_mask
        assert_same_ground(model, terrain_map, ~binary_dilation(~covered, AROUND))
    else:
        assert model.ngeom == 1 + 4  # and the border


@pytest.mark.parametrize(
    ("border", "centered"), [(0.0, False), (0.1, True), (0.2, False), (0.3, True), (2.0, True)]
)
@every_collision
def test_mjcf_ground_extends_to_the_border(tmp_path, border, centered, collision):
    terrain_map = course(*"/P", rows=1, patch_size=(3.0, 2.0), border=border, centered=centered)
    assert_same_ground(loaded(terrain_map, tmp_path, collision=collision), terrain_map)


ROBOT = read_table(__file__, "robot")


@pytest.mark.parametrize("place", ["before", "after"])
@every_collision
def test_mjcf_ignores_defaults_of_a_robot(terrain_map, tmp_path, place, collision):
    alone = loaded(terrain_map, tmp_path, collision=collision)
    scene = ROBOT.format(**{"before": "", "after": ""} | {place: '<include file="terrain.xml"/>'})
    (tmp_path / "scene.xml").write_text(scene)
    model = mujoco.MjModel.from_xml_path(str(tmp_path / "scene.xml"))
    ground = np.flatnonzero(model.geom_bodyid == 0)
    assert len(ground) == alone.ngeom == model.ngeom - 1
    names = "pos size contype conaffinity condim priority friction solmix solref solimp margin gap"
    for name in (*names.split(), "group", "rgba"):
        found, wanted = (getattr(each, f"geom_{name}") for each in (model, alone))
        assert found[ground].tolist() == wanted.tolist()
    data = mujoco.MjData(model)
    for origin in terrain_map.env_origins.reshape(-1, 3).astype(float):
        mujoco.mj_resetData(model, data)
        data.qpos[:3] = origin + 0.3 * UP
        mujoco.mj_step(model, data, nstep=700)
        assert np.abs(data.qvel).max() < 0.01
        np.testing.assert_allclose(data.qpos[:3], origin + 0.1 * UP, atol=2e-3)


def friction_map(terrain, side=None, **rest):
    """Return a map whose second column has its own friction, and a third one friction patches."""
    overlays = (FrictionPatches(**{} if side is None else {"side": side}),)
    terrains = (
        SubTerrain(terrain=terrain, name="plain"),
        SubTerrain(terrain=terrain, name="icy", friction=(0.5, 0.25)),
        SubTerrain(terrain=terrain, name="patchy", overlays=overlays),
    )
    size = {"rows": 2, "cols": 3, "patch_size": (6.0, 4.0), "border": 1.0, "seed": 3}
    return generate(MapConfig(terrains=terrains, static_friction=0.8, **size | rest))


@pytest.mark.parametrize("terrain", ["flat", "stairs", "rough"])
@every_collision
def test_mjcf_has_friction_of_each_cell(tmp_path, terrain, collision):
    terrain_map = friction_map(terrain)
    model = loaded(terrain_map, tmp_path, collision=collision)
    cells = np.random.default_rng(0).integers(0, terrain_map.heights.shape, (1000, 2))
    offset = 0.45  # boxes have exact edges
    if model.nhfield:
        # A heightfield ends at a sample, half a cell beyond the edge.
        friction, offset = np.pad(terrain_map.friction, 1, mode="edge"), 0.1
        block = np.array([friction[i : i + 3, j : j + 3] for i, j in cells])
        cells = cells[(block == block[:, 1:2, 1:2]).all(axis=(1, 2))]
    xy = terrain_map.first_sample + (cells + offset) * terrain_map.grid.cell
    expected = terrain_map.friction[tuple(cells.T)]
    assert ray_cast(model, xy)[1] == pytest.approx(expected, abs=1e-6)
    assert len(np.unique(expected)) > 10


def test_mjcf_has_few_heightfields_on_a_map_of_large_cells(tmp_path):
    """Heightfields of 16 m would have 2 samples each, and some would be beyond the map."""
    hills = SubTerrain(
        terrain="wave", parameters={"amplitude": 20.0, "number": 2, "platform": 60.0}
    )
    size = {"rows": 1, "cols": 1, "patch_size": (700.0, 500.0), "cell": 10.0, "border": 0.0}
    terrain_map = generate(
        MapConfig(**size, spawn_radius=5.0, spawn_tolerance=9.0, terrains=(hills,))
    )
    model = loaded(terrain_map, tmp_path, collision="boxes")
    assert model.nhfield == 4  # 74 x 54 samples, in parts of about 32
    xy = np.random.default_rng(0).uniform((20, 20), (680, 480), (200, 2))
    np.testing.assert_allclose(ray_cast(model, xy)[0], terrain_map.height(xy), atol=0.01)


def test_mjcf_splits_a_heightfield_where_the_friction_changes():
    """Cells 2 to 3 of 8 along x are slippery: samples 4 to 6 with the margin of 2."""
    terrain_map = plot(np.zeros((8, 3)), static_friction=0.8)
    friction = np.full((8, 3), 0.8, np.float32)
    friction[2:4, :2] = 0.25
    split = dataclasses.replace(terrain_map, friction=friction)
    model = mjcf_map.make_model(split, "hfield")
    parts = [
        (x.start, x.stop, y.start, y.stop, round(value, 3))
        for (x, y), value in model.hfields.values()
    ]
    assert sorted(parts) == [
        (0, 5, 0, 5, 0.8),
        (0, 12, 4, 7, 0.8),
        (4, 7, 0, 5, 0.25),
        (6, 12, 0, 5, 0.8),
    ]
    (icy,) = (each for each in model.geoms() if "friction" in each)
    assert (icy["friction"], icy["priority"]) == ((0.25, 0.005, 0.0001), 2)
