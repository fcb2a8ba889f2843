import mujoco
import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from hypothesis.extra.numpy import arrays

from terrainkit_robots.analysis.inertia.physical import (
    box_inertia,
    gyration_radius,
    is_in_range,
    is_zero,
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


SOUND = np.array([[3.0, 0.2, 0.1], [0.2, 2.5, -0.3], [0.1, -0.3, 2.0]])
DIAGONAL = np.diag([1.0, 1.2, 1.4])


@pytest.mark.parametrize(
    ("inertia", "nearest"),
    [
        (SOUND, SOUND),
        (-DIAGONAL, DIAGONAL),
        # The second moments 0.5, 0.5 and -0.25 become 0.5, 0.5 and 0.0005.
        (np.diag([0.25, 0.25, 1.0]), np.diag([0.5005, 0.5005, 1.0])),
    ],
    ids=["physical", "negative", "small moments"],
)
def test_nearest_physical(inertia, nearest):
    assert nearest_physical(inertia) == pytest.approx(nearest, abs=1e-12)
    assert nearest_physical(np.zeros((3, 3))) is None


@pytest.mark.parametrize(
    ("element", "zero", "in_range"),
    [(1e-14, True, True), (-1.1e-14, False, True), (-0.9e12, False, True), (-1e12, False, False)],
)
def test_elements_of_an_inertia_have_a_range(element, zero, in_range):
    inertia = np.zeros((3, 3))
    inertia[0, 1] = element
    assert (is_zero(inertia), is_in_range(inertia)) == (zero, in_range)


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
