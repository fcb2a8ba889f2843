import mujoco
import numpy as np
import pytest

from terrainkit_robots.rl.hfield_window import HeightfieldWindows

ROWS, COLS = 21, 31

SCENE = """
<mujoco>
  <asset><hfield name="hill" nrow="{rows}" ncol="{cols}" size="3 2 1 0.1"/></asset>
  <worldbody>
    {before}
    <geom name="ground" type="hfield" hfield="hill" {more}/>
    {after}
  </worldbody>
</mujoco>
"""


def model_of(more="", before="", after=""):
    text = SCENE.format(rows=ROWS, cols=COLS, more=more, before=before, after=after)
    model = mujoco.MjModel.from_xml_string(text)
    model.hfield_data[:] = np.random.default_rng(1).random(ROWS * COLS)
    return model


def heights(model, xy):
    """Return the height of the ground under points by rays, NaN where there is none."""
    data = mujoco.MjData(model)
    mujoco.mj_kinematics(model, data)
    found = np.full(len(xy), np.nan)
    down, hit = np.array([0.0, 0, -1]), np.zeros(1, np.int32)
    for k, (x, y) in enumerate(xy):
        far = mujoco.mj_ray(model, data, np.array([x, y, 9.0]), down, None, 1, -1, hit, None)
        found[k] = 9 - far if far >= 0 else np.nan
    return found


@pytest.mark.parametrize("more", ["", 'pos="0.3 -0.2 0.5" euler="0 0 40"'])
def test_what_is_left_is_where_and_as_high_as_before(more):
    model = model_of(more)
    turn = np.radians(40 if more else 0)
    out = np.array([[np.cos(turn), np.sin(turn)], [-np.sin(turn), np.cos(turn)]])
    middle = np.array([0.3, -0.2]) if more else np.zeros(2)
    rng = np.random.default_rng(0)
    shown = rng.uniform((-0.9, -0.5), (1.1, 1.3), (100, 2)) @ out + middle
    before = heights(model, shown)
    assert not np.isnan(before).any()
    windows = HeightfieldWindows(model)
    assert windows.show(shown) == [0]
    np.testing.assert_allclose(heights(model, shown), before, atol=1e-6)
    assert model.hfield_ncol[0] < 15
    assert model.hfield_nrow[0] < 15
    beyond = np.array([[2.5, 0.0], [0.0, -1.8]]) @ out + middle
    assert np.isnan(heights(model, beyond)).all()


def test_another_part_can_be_shown_afterwards_and_all_again():
    model = model_of()
    everywhere = np.random.default_rng(0).uniform((-3, -2), (3, 2), (100, 2))
    before = heights(model, everywhere)
    windows = HeightfieldWindows(model)
    windows.show(np.array([[-2, -1], [-1, 0]]))
    windows.show(np.array([[1, 0], [2, 1]]))
    assert np.isnan(heights(model, np.array([[-1.5, -0.5]]))).all()
    windows.show(np.array([[-90, -90], [90, 90]]))
    np.testing.assert_allclose(heights(model, everywhere), before, atol=1e-6)
    assert (model.hfield_nrow[0], model.hfield_ncol[0]) == (ROWS, COLS)


@pytest.mark.parametrize("at", [(50, 0), (-50, -50), (0, 1.99)])
def test_points_beside_it_leave_a_cell_or_more(at):
    model = model_of()
    HeightfieldWindows(model).show(np.array([at], float))
    assert model.hfield_nrow[0] >= 2
    assert model.hfield_ncol[0] >= 2
    assert (model.hfield_size[0] > 0).all()


@pytest.mark.parametrize(
    "parts",
    [
        {"more": 'euler="30 0 0"'},
        {"after": '<geom type="hfield" hfield="hill" pos="9 0 0"/>'},
        {"before": '<body><freejoint/><geom size="1"/>', "after": "</body>"},
    ],
    ids=["tilted", "twice", "moving"],
)
def test_what_cannot_be_cut_stays_whole(parts):
    model = model_of(**parts)
    assert HeightfieldWindows(model).show(np.zeros((1, 2))) == []
    assert (model.hfield_nrow[0], model.hfield_ncol[0]) == (ROWS, COLS)


def test_a_model_without_any_has_none():
    model = mujoco.MjModel.from_xml_string("<mujoco/>")
    assert HeightfieldWindows(model).show(np.zeros((1, 2))) == []
