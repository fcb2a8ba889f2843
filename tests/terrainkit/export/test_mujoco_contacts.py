"""A course of a bar, a tunnel and open stairs, passed by rays and by falling balls in MuJoCo."""

import mujoco
import numpy as np
import pytest

from terrainkit import MapConfig, SubTerrain, generate

LANES = ("crawl", "tunnel", "open_stairs")
RADIUS = 0.04
STEP = 0.05


@pytest.fixture(scope="module")
def course():
    return generate(
        MapConfig(
            rows=1,
            cols=len(LANES),
            border=1.0,
            difficulty_range=(0.6, 0.6),
            terrains=tuple(SubTerrain(terrain=name) for name in LANES),
        )
    )


@pytest.fixture(scope="module")
def spec_file(course, tmp_path_factory):
    return str(course.save(tmp_path_factory.mktemp("course") / "course.xml", collision="boxes"))


def lane(course, col):
    """Return points from the spawn origin to the last goal, shape (n, 2)."""
    x, y, _ = course.env_origins[0, col]
    goals = course.goals[0, col]
    end = goals[~np.isnan(goals[:, 0])][-1, 0]
    steps = np.arange(x, end, STEP)
    return np.column_stack([steps, np.full(len(steps), y)])


def is_near_edge(course, xy, distance=0.01):
    """Return whether the surface seen from above changes within `distance` along the lane."""
    x, y = xy.T
    beside = [
        course.scan(np.column_stack([x + dx, y, np.full(len(x), 5.0)]))
        for dx in (-distance, 0.0, distance)
    ]
    return np.ptp(beside, axis=0) > 0.01


@pytest.mark.parametrize("col", range(len(LANES)), ids=LANES)
@pytest.mark.parametrize("height", [0.1, 5.0], ids=["low", "high"])
def test_course_scan_agrees_with_mujoco_along_each_lane(course, spec_file, col, height):
    """A robot that walks below the solids and one above them see what MuJoCo's rays hit."""
    model = mujoco.MjModel.from_xml_path(spec_file)
    data = mujoco.MjData(model)
    mujoco.mj_forward(model, data)
    xy = lane(course, col)
    xy = xy[~is_near_edge(course, xy)]
    starts = np.column_stack([xy, course.height(xy) + height])
    geom, normal = np.zeros(1, dtype=np.int32), np.zeros(3)
    for direction, sign in (("down", -1.0), ("up", 1.0)):
        hit = [
            mujoco.mj_ray(model, data, start, [0, 0, sign], None, 1, -1, geom, normal)
            for start in starts
        ]
        z = np.where(np.array(hit) < 0, np.nan, starts[:, 2] + sign * np.array(hit))
        found = course.scan(starts, direction)
        assert found == pytest.approx(z, abs=1e-3, nan_ok=True)
    roofs = ~np.isnan(course.scan(starts, "up"))
    assert roofs.any() == (height < 1)


@pytest.mark.parametrize("col", range(len(LANES)), ids=LANES)
def test_course_balls_rest_on_the_first_surface(course, spec_file, col):
    """Balls are dropped from above everything, and on the ground under each roof."""
    xy = lane(course, col)[::4]
    xy = xy[~is_near_edge(course, xy, distance=2 * RADIUS)]
    above = np.column_stack([xy, np.full(len(xy), 3.0)])
    under = np.column_stack([xy, course.height(xy) + 2 * RADIUS])
    clearance = course.clearance(xy)
    under = under[(clearance > 4 * RADIUS) & np.isfinite(clearance)]
    assert len(under) > 1
    starts = np.concatenate([above, under])
    expected = course.scan(starts) + RADIUS
    spec = mujoco.MjSpec.from_file(spec_file)
    for start in starts:
        ball = spec.worldbody.add_body(pos=start)
        ball.add_freejoint()
        # The balls hit the terrain, not one another.
        ball.add_geom(
            type=mujoco.mjtGeom.mjGEOM_SPHERE, size=[RADIUS, 0, 0], mass=1, contype=0, conaffinity=1
        )
    model = spec.compile()
    data = mujoco.MjData(model)
    mujoco.mj_step(model, data, 800)
    assert data.xpos[-len(starts) :, 2] == pytest.approx(expected, abs=3e-3)
