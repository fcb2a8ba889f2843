import mujoco
import numpy as np
import pytest

from terrainkit import MapConfig, generate
from terrainkit_robots.rl.box_tops import set_box_tops_apart


def model_of(*boxes, more=""):
    """Return a model of boxes, each given as its lower and upper corner."""
    geoms = ""
    for low, high in boxes:
        middle, half = (np.add(low, high)) / 2, np.subtract(high, low) / 2
        pos, size = (" ".join(map(str, each)) for each in (middle, half))
        geoms += f'<geom type="box" pos="{pos}" size="{size}"/>'
    return mujoco.MjModel.from_xml_string(f"<mujoco><worldbody>{geoms}{more}</worldbody></mujoco>")


def tops(model):
    return model.geom_pos[:, 2] + model.geom_size[:, 2]


def corners(model):
    return model.geom_pos - model.geom_size, model.geom_pos + model.geom_size


def test_of_tops_that_overlap_in_one_plane_one_is_lowered():
    model = model_of(((0, 0, 0), (2, 1, 0.5)), ((1, 0, 0), (2, 3, 0.5)))
    set_box_tops_apart(model)
    np.testing.assert_allclose(tops(model), [0.5, 0.499])


def test_four_steps_around_a_platform_need_two_heights():
    model = model_of(
        ((0, 0, 0), (1, 4, 0.5)),
        ((3, 0, 0), (4, 4, 0.5)),
        ((0, 0, 0), (4, 1, 0.5)),
        ((0, 3, 0), (4, 4, 0.5)),
    )
    set_box_tops_apart(model)
    np.testing.assert_allclose(tops(model), [0.5, 0.5, 0.499, 0.499])


@pytest.mark.parametrize(
    ("low", "high"),
    [
        ((1, 0, 0), (2, 1, 0.5)),  # side by side
        ((0, 0, 0), (2, 2, 0.6)),  # another height
        ((5, 0, 0), (6, 1, 0.5)),  # far away
    ],
)
def test_boxes_that_share_no_place_stay(low, high):
    model = model_of(((0, 0, 0), (1, 1, 0.5)), (low, high))
    before = model.geom_pos.copy()
    set_box_tops_apart(model)
    np.testing.assert_array_equal(model.geom_pos, before)


@pytest.mark.parametrize(
    "more",
    [
        '<geom type="box" size="1 1 0.5" euler="30 0 0"/>',
        '<geom type="cylinder" size="1 0.5"/>',
        '<body><freejoint/><geom type="box" size="1 1 0.5"/></body>',
    ],
)
def test_only_upright_boxes_of_the_ground_are_lowered(more):
    model = model_of(((-1, -1, -0.5), (1, 1, 0.5)), more=more)
    before = model.geom_pos.copy()
    set_box_tops_apart(model)
    np.testing.assert_array_equal(model.geom_pos, before)


def test_a_box_at_the_origin_is_lowered_where_mujoco_looks_for_it():
    model = model_of(((-1, -1, 0), (1, 1, 0.5)), ((-1, -1, -0.5), (1, 1, 0.5)))
    set_box_tops_apart(model)
    data = mujoco.MjData(model)
    mujoco.mj_kinematics(model, data)
    np.testing.assert_allclose(data.geom_xpos[:, 2], [0.25, -0.001])


def test_of_a_turned_body_it_is_lowered_in_the_world():
    more = '<body euler="0 90 0"><geom type="box" size="1 1 1" euler="0 -90 0"/></body>'
    model = model_of(((-1, -1, 0), (1, 1, 1)), more=more)
    set_box_tops_apart(model)
    data = mujoco.MjData(model)
    mujoco.mj_kinematics(model, data)
    np.testing.assert_allclose(data.geom_xpos[1], [0, 0, -0.001], atol=1e-9)


def test_on_a_map_no_tops_that_overlap_stay_in_one_plane(tmp_path):
    path = generate(MapConfig(rows=2, cols=10)).save(tmp_path / "map.xml", collision="boxes")
    model = mujoco.MjModel.from_xml_path(str(path))
    boxes = np.flatnonzero(model.geom_type == mujoco.mjtGeom.mjGEOM_BOX)
    before = tops(model)[boxes]
    set_box_tops_apart(model)
    low, high = (each[boxes] for each in corners(model))
    overlap = (low[:, None, :2] < high[None, :, :2] - 1e-6).all(axis=2)
    overlap &= overlap.T & ~np.eye(len(boxes), dtype=bool)
    same = overlap & (np.abs(before[:, None] - before) < 1e-6)
    apart = np.abs(high[:, None, 2] - high[:, 2])
    assert same.any()  # or there is nothing to do
    assert apart[same].min() > 0.0009
    assert apart[overlap].min() > 1e-6
    assert (before - high[:, 2]).max() < 0.01
