import mujoco
import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from hypothesis.extra.numpy import arrays

from terrainkit_robots.analysis.inertia.physical import (
    box_inertia,
    gyration_radius,
    nearest_physical,
    principal_moments,
    triangle_ratio,
)

numbers = st.floats(-10, 10).filter(lambda x: x == 0 or abs(x) > 1e-3)


def symmetric(matrix):
    return (matrix + matrix.T) / 2


def mujoco_takes(inertia):
    xx, yy, zz = np.diag(inertia)
    six = [xx, yy, zz, inertia[0, 1], inertia[0, 2], inertia[1, 2]]
    text = " ".join(f"{x:.10g}" for x in six)
    mujoco.MjModel.from_xml_string(
        "<mujoco><worldbody><body><freejoint/>"
        f'<inertial pos="0 0 0" mass="1" fullinertia="{text}"/></body></worldbody></mujoco>'
    )


def test_triangle_ratio_of_plate_and_ball():
    assert triangle_ratio(np.array([0.5, 0.5, 1.0])) == 1.0
    assert triangle_ratio(np.array([1.0, 1.0, 1.0])) == 2.0


def test_box_inertia_matches_mujoco():
    sides = np.array([0.2, 0.3, 0.5])
    model = mujoco.MjModel.from_xml_string(
        "<mujoco><worldbody><body><freejoint/>"
        '<geom type="box" size="0.1 0.15 0.25" mass="2"/></body></worldbody></mujoco>'
    )
    ours = np.sort(np.diag(box_inertia(2.0, sides)))
    assert ours == pytest.approx(np.sort(model.body_inertia[1]))


def test_nearest_physical_raises_small_moments():
    nearest = nearest_physical(np.diag([0.25, 0.25, 1.0]))
    assert np.diag(nearest) == pytest.approx([0.5, 0.5, 1.0], abs=1e-3)
    assert np.count_nonzero(nearest - np.diag(np.diag(nearest))) == 0


def test_nearest_physical_keeps_physical_inertia():
    sound = symmetric(np.array([[3.0, 0.2, 0.1], [0.2, 2.5, -0.3], [0.1, -0.3, 2.0]]))
    assert nearest_physical(sound) == pytest.approx(sound, abs=1e-12)


def test_nearest_physical_negates_negative_inertia():
    assert nearest_physical(-np.diag([1.0, 1.2, 1.4])) == pytest.approx(np.diag([1.0, 1.2, 1.4]))


def test_nearest_physical_of_zero_is_none():
    assert nearest_physical(np.zeros((3, 3))) is None


@given(arrays(np.float64, (3, 3), elements=numbers))
@settings(max_examples=60, deadline=None)
def test_nearest_physical_is_accepted_by_mujoco(matrix):
    nearest = nearest_physical(symmetric(matrix))
    if nearest is None:
        assert principal_moments(symmetric(matrix)) == pytest.approx(np.zeros(3), abs=1e-12)
        return
    assert triangle_ratio(principal_moments(nearest)) >= 1 + 1e-4
    mujoco_takes(nearest)


def test_gyration_radius_of_rod():
    moments = np.array([1e-9, 1 / 12, 1 / 12])
    assert gyration_radius(moments, 1.0) == pytest.approx(12**-0.5)
    assert gyration_radius(moments, 0.0) == 0.0
    assert gyration_radius(np.array([1.0, 1.0, 1e308]), 1e-308) == 0.0
