import mujoco
import numpy as np
import pytest

from terrainkit import MapConfig, generate
from terrainkit_robots.rendering.video_frames import (
    cut_heightfields,
    offset_box_tops,
    smooth_path,
)

ROWS, COLS = 21, 31


def test_smooth_path_keeps_line_and_removes_jitter():
    path = np.zeros((100, 3), np.float32)
    path[:, 0] = np.linspace(0, 6, 100)
    path[:, 2] = 0.3 + 0.05 * (-1.0) ** np.arange(100)
    smooth = smooth_path(path, 8.0)
    assert smooth.shape == path.shape
    np.testing.assert_allclose(smooth[:, 0], path[:, 0], atol=1e-4)
    assert np.ptp(smooth[25:-25, 2]) < 1e-3
    assert smooth_path(path[:1], 8.0).shape == (1, 3)


def make_hfield(attributes="", body="<body>{}</body>"):
    geom = f'<geom name="ground" type="hfield" hfield="hill" {attributes}/>'
    model = mujoco.MjModel.from_xml_string(
        f'<mujoco><asset><hfield name="hill" nrow="{ROWS}" ncol="{COLS}" size="3 2 1 0.1"/></asset>'
        f"<worldbody>{body.format(geom)}</worldbody></mujoco>"
    )
    model.hfield_data[:] = np.random.default_rng(1).random(ROWS * COLS)
    return model


def ground_heights(model, xy):
    """Return the height of the ground under points by ray casting, NaN where there is none."""
    data = mujoco.MjData(model)
    mujoco.mj_kinematics(model, data)
    heights = np.full(len(xy), np.nan)
    down, hit = np.array([0.0, 0, -1]), np.zeros(1, np.int32)
    for k, (x, y) in enumerate(xy):
        depth = mujoco.mj_ray(model, data, np.array([x, y, 9.0]), down, None, 1, -1, hit, None)
        heights[k] = 9 - depth if depth >= 0 else np.nan
    return heights


@pytest.mark.parametrize("attributes", ["", 'pos="0.3 -0.2 0.5"'])
@pytest.mark.parametrize("body", ["{}", '<body pos="0.2 0.1 0">{}</body>'])
def test_cut_heightfields_keeps_heights(attributes, body):
    model = make_hfield(attributes, body)
    points = np.random.default_rng(0).uniform((-0.9, -0.5), (1.1, 1.3), (100, 2))
    before = ground_heights(model, points)
    assert not np.isnan(before).any()
    cropped = cut_heightfields(model, points)
    np.testing.assert_allclose(ground_heights(cropped, points), before, atol=1e-6)
    assert cropped.hfield_ncol[0] < 15
    assert cropped.hfield_nrow[0] < 15
    assert np.isnan(ground_heights(cropped, np.array([[2.5, 0.0], [0.0, -1.8]]))).all()
    assert (model.hfield_nrow[0], model.hfield_ncol[0]) == (ROWS, COLS)


def test_cut_heightfields_of_everything_changes_nothing():
    model = make_hfield()
    points = np.random.default_rng(0).uniform((-3, -2), (3, 2), (100, 2))
    cropped = cut_heightfields(model, np.array([[-90.0, -90], [90, 90]]))
    np.testing.assert_allclose(
        ground_heights(cropped, points), ground_heights(model, points), atol=1e-6
    )
    assert (cropped.hfield_nrow[0], cropped.hfield_ncol[0]) == (ROWS, COLS)


@pytest.mark.parametrize("at", [(50.0, 0.0), (-50.0, -50.0), (0.0, 1.99)])
def test_cut_heightfields_keeps_one_cell(at):
    cropped = cut_heightfields(make_hfield(), np.array([at]))
    assert cropped.hfield_nrow[0] >= 2
    assert cropped.hfield_ncol[0] >= 2
    assert (cropped.hfield_size[0] > 0).all()


@pytest.mark.parametrize(
    ("attributes", "body"),
    [('euler="0 0 40"', "{}"), ("", '<body pos="0 0 1"><joint/><geom size="1"/>{}</body>')],
)
def test_cut_heightfields_skips_rotated_or_moving(attributes, body):
    cropped = cut_heightfields(make_hfield(attributes, body), np.zeros((1, 2)))
    assert (cropped.hfield_nrow[0], cropped.hfield_ncol[0]) == (ROWS, COLS)


def make_boxes(*boxes, more=""):
    """Return a model of boxes, each given as its lower and upper corner."""
    geoms = ""
    for low, high in boxes:
        center, half = (np.add(low, high)) / 2, np.subtract(high, low) / 2
        pos, size = (" ".join(map(str, each)) for each in (center, half))
        geoms += f'<geom type="box" pos="{pos}" size="{size}"/>'
    return mujoco.MjModel.from_xml_string(f"<mujoco><worldbody>{geoms}{more}</worldbody></mujoco>")


def box_tops(model):
    return model.geom_pos[:, 2] + model.geom_size[:, 2]


def test_offset_box_tops_lowers_one_of_two():
    model = make_boxes(((0, 0, 0), (2, 1, 0.5)), ((1, 0, 0), (2, 3, 0.5)))
    offset_box_tops(model)
    np.testing.assert_allclose(box_tops(model), [0.5, 0.499])


def test_offset_box_tops_uses_two_layers_for_ring():
    model = make_boxes(
        ((0, 0, 0), (1, 4, 0.5)),
        ((3, 0, 0), (4, 4, 0.5)),
        ((0, 0, 0), (4, 1, 0.5)),
        ((0, 3, 0), (4, 4, 0.5)),
    )
    offset_box_tops(model)
    np.testing.assert_allclose(box_tops(model), [0.5, 0.5, 0.499, 0.499])


@pytest.mark.parametrize(
    ("low", "high"),
    [
        ((1, 0, 0), (2, 1, 0.5)),  # side by side
        ((0, 0, 0), (2, 2, 0.6)),  # another height
        ((5, 0, 0), (6, 1, 0.5)),  # far away
    ],
)
def test_offset_box_tops_keeps_separate_boxes(low, high):
    model = make_boxes(((0, 0, 0), (1, 1, 0.5)), (low, high))
    before = model.geom_pos.copy()
    offset_box_tops(model)
    np.testing.assert_array_equal(model.geom_pos, before)


@pytest.mark.parametrize(
    "more",
    [
        '<geom type="box" size="1 1 0.5" euler="30 0 0"/>',
        '<body euler="0 90 0"><geom type="box" size="1 1 1" euler="0 -90 0"/></body>',
        '<geom type="cylinder" size="1 0.5"/>',
        '<body><freejoint/><geom type="box" size="1 1 0.5"/></body>',
    ],
)
def test_offset_box_tops_skips_other_geoms(more):
    model = make_boxes(((-1, -1, -0.5), (1, 1, 0.5)), more=more)
    before = model.geom_pos.copy()
    offset_box_tops(model)
    np.testing.assert_array_equal(model.geom_pos, before)


def test_offset_box_tops_moves_box_at_origin():
    model = make_boxes(((-1, -1, 0), (1, 1, 0.5)), ((-1, -1, -0.5), (1, 1, 0.5)))
    offset_box_tops(model)
    data = mujoco.MjData(model)
    mujoco.mj_kinematics(model, data)
    np.testing.assert_allclose(data.geom_xpos[:, 2], [0.25, -0.001])


def test_offset_box_tops_of_map(tmp_path):
    path = generate(MapConfig(rows=2, cols=10)).save(tmp_path / "map.xml", collision="boxes")
    model = mujoco.MjModel.from_xml_path(str(path))
    boxes = np.flatnonzero(model.geom_type == mujoco.mjtGeom.mjGEOM_BOX)
    before = box_tops(model)[boxes]
    offset_box_tops(model)
    low = (model.geom_pos - model.geom_size)[boxes]
    high = (model.geom_pos + model.geom_size)[boxes]
    overlap = (low[:, None, :2] < high[None, :, :2] - 1e-6).all(axis=2)
    overlap &= overlap.T & ~np.eye(len(boxes), dtype=bool)
    coplanar = overlap & (np.abs(before[:, None] - before) < 1e-6)
    distance = np.abs(high[:, None, 2] - high[:, 2])
    assert coplanar.any()  # or there is nothing to test
    assert distance[coplanar].min() > 0.0009
    assert distance[overlap].min() > 1e-6
    assert (before - high[:, 2]).max() < 0.01
