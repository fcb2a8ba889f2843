from dataclasses import replace

import numpy as np
import pytest

from terrainkit import MapConfig, SubTerrain, TerrainMap, generate, make_patch
from terrainkit.errors import ConfigError
from terrainkit.map.validate import validate
from terrainkit.overlays.side_walls import SideWalls
from terrainkit.terrain import registry
from terrainkit.terrains.course import Course, Element
from tests.tables import read_table
from tests.terrains import edges, heights_of

BLOCK = {"min_spacing": 1.0, "max_spacing": 1.0, "min_thickness": 0.4, "max_thickness": 0.4}
"""Hurdles in the middle of slots of 1 m."""


def config_of(*elements, size=(8.0, 4.0), overlays=(), rows=1, **parameters):
    sub_terrain = SubTerrain(
        terrain="course", parameters={"elements": elements, **parameters}, overlays=overlays
    )
    return MapConfig(rows=rows, cols=1, patch_size=size, border=0.0, terrains=(sub_terrain,))


def patch_of(*elements, **options):
    return make_patch(config_of(*elements, **options), 0, 0)


def hurdle(height, **rest):
    return {"terrain": "hurdles", "height": height, **BLOCK, **rest}


def test_course_elements_share_the_length():
    """8 m: a start of 2 m at both ends, a platform of 1 m, and 1.5 m for each element.

    A hurdle is in the middle of the meter behind a start of 0.2 m.
    """
    patch = patch_of(hurdle(0.1), hurdle(0.2))
    assert edges(patch.heights[:, 20]) == [25, 29, 50, 54]
    assert patch.heights[[26, 51], 20] == pytest.approx([0.1, 0.2])
    assert patch.goals == pytest.approx(np.array([[4, 2, 0, 0], [7, 2, 0, 0]]), abs=1e-6)
    assert patch.spawns == pytest.approx(np.array([[1, 2, 0, 0]]), abs=1e-6)


def test_course_elements_have_their_own_length():
    """The second element gets twice the share of the first of the 9 m that are left of 20 m."""
    patch = patch_of(
        hurdle(0.1, start=2.0),
        hurdle(0.1, proportion=2.0, start=5.0),
        hurdle(0.1, element_length=5.0, start=4.0),
        size=(20.0, 4.0),
    )
    assert edges(patch.heights[:, 20]) == [43, 47, 113, 117, 173, 177]
    realized = patch.parameters.realized
    assert realized["elements[2].element_length"] == 5
    assert realized["elements"] == "hurdles, hurdles, hurdles"


def test_course_backward_reverses_goals_and_spawn():
    patch = patch_of(hurdle(0.1), hurdle(0.2), backward=True)
    assert (patch.heights == patch_of(hurdle(0.1), hurdle(0.2)).heights).all()
    assert patch.spawns == pytest.approx(np.array([[7, 2, 0, np.pi]]), abs=1e-6)
    assert patch.goals == pytest.approx(np.array([[4, 2, 0, np.pi], [1, 2, 0, np.pi]]), abs=1e-6)


def test_course_random_fills_any_length():
    """18 m: 14 m between the ends hold five elements of 2 m, with 1 m behind all but the last."""
    elements = (hurdle(0.1), hurdle(0.2, proportion=3.0))
    patches = [patch_of(*elements, size=(x, 4.0), order="random") for x in (6.0, 18.0, 60.0)]
    assert [len(each.goals) for each in patches] == [1, 5, 19]
    high = patches[2].heights[25 + 30 * np.arange(19), 20]
    assert set(high.tolist()) == {np.float32(0.1), np.float32(0.2)}
    assert (high > 0.15).sum() > 9


def test_course_same_column_has_the_same_elements_at_each_level():
    elements = (hurdle((0.1, 0.2)), {"terrain": "crawl", "spacing": 0.8}, {"terrain": "slit"})
    terrain_map = generate(config_of(*elements, size=(18.0, 4.0), rows=3, order="random"))
    assert list(validate(terrain_map)) == []
    easy, hard = (terrain_map.patch(row, 0) for row in (0, 2))
    assert np.array_equal(easy.heights > 0, hard.heights > 0)
    assert len(easy.solids) == len(hard.solids)
    assert hard.parameters.requested["elements[0].height"] == 0.2


def test_course_solids_stand_where_their_element_is():
    """Ground and solids come from two generators, which have to agree on the order."""
    bar = {"terrain": "crawl", "spacing": 0.8}
    for seed in range(4):
        config = config_of(hurdle(0.1), bar, size=(30.0, 4.0), order="random")
        patch = make_patch(replace(config, seed=seed), 0, 0)
        slots = [slice(20 + 30 * k, 40 + 30 * k) for k in range(9)]
        has_hurdle = [bool(patch.heights[each, 20].any()) for each in slots]
        x = (patch.solids.boxes[:, 0] / patch.grid.cell).tolist()
        has_bar = [any(each.start <= i < each.stop for i in x) for each in slots]
        assert has_bar == [not each for each in has_hurdle]
        assert len(set(has_bar)) == 2


@pytest.mark.parametrize("name", sorted({*registry.terrain_names()} - {"course"}))
def test_course_takes_every_terrain(name):
    """Goals and spawn are on level ground at height 0, with nothing above them."""
    walls = SideWalls(probability=1.0)
    config = config_of({"terrain": name}, size=(12.0, 8.0), rows=2, overlays=(walls,))
    terrain_map = generate(config)
    assert list(validate(terrain_map)) == []
    points = np.concatenate([terrain_map.goals[:, 0, :, :3], terrain_map.spawns[:, 0, :, :3]])
    assert points[..., 0].ravel().tolist() == pytest.approx([11, 23, 1, 13])
    angle = np.linspace(0, 2 * np.pi, 12)
    disk = points[..., :2] + 0.4 * np.stack([np.cos(angle), np.sin(angle)], axis=-1)
    assert not points[..., 2].any()
    assert not terrain_map.height(disk).any()
    assert np.isinf(terrain_map.clearance(disk)).all()


@pytest.mark.parametrize(
    ("parameters", "message"),
    [
        *read_table(__file__, "course_rejects_bad_elements"),
        ({"elements": [{"terrain": "pit"}] * 101}, r"course\.elements: got 101; expected 1 to 100"),
    ],
)
def test_course_rejects_bad_elements(parameters, message):
    with pytest.raises(ConfigError, match=message):
        SubTerrain.from_table({"terrain": "course", **parameters})


@pytest.mark.parametrize(
    ("elements", "options", "message"),
    [
        (
            [hurdle(0.1, element_length=4.1)],
            {},
            r"got 1 elements, 4\.1 m of own lengths.* 8 m long",
        ),
        ([hurdle(0.1)] * 9, {}, r"course: got 9 elements"),
        ([hurdle(0.1, element_length=2.1)], {"order": "random"}, r"got elements up to 2\.1 m long"),
        ([hurdle(0.1)], {"order": "random", "slot_length": 4.1}, r"slot_length 4\.1 m and a"),
        ([{"terrain": "pit", "side": 4.1}], {}, r"course\.elements\[0\]: pit: side 4\.1 m does"),
        ([{"terrain": "slope", "landing": 0.2, "grade": 0.9}], {}, r"\[0\]\.grade: got 0\.9"),
    ],
)
def test_course_rejects_elements_that_do_not_fit(elements, options, message):
    with pytest.raises(ConfigError, match=message):
        patch_of(*elements, **options)


def test_course_takes_elements_that_just_fit():
    for options in ({}, {"order": "random", "slot_length": 4.0}):
        assert len(patch_of(hurdle(0.1, element_length=4.0), **options).goals) == 1


def test_course_survives_toml_and_npz(tmp_path):
    slit = {"terrain": "slit", "opening": (1.3, 1.0), "element_length": 2.5}
    config = config_of(slit, {"terrain": "rough"}, size=(12.0, 4.0), rows=2)
    assert MapConfig.from_toml(config.to_toml()) == config
    terrain_map = generate(config)
    loaded = TerrainMap.load(terrain_map.save(tmp_path / "map.npz"))
    assert loaded.config == config
    assert loaded.parameters[1, 0] == terrain_map.parameters[1, 0]
    assert loaded.parameters[1, 0].requested["elements[0].opening"] == 1.0
    assert list(validate(loaded)) == []


def test_course_in_python_takes_the_hard_ends():
    course = Course(elements=(Element(terrain="hurdles", parameters=BLOCK),))
    assert heights_of(course).max() == np.float32(0.5)
