import mujoco
import numpy as np
import pytest

from terrainkit_robots.onboarding.visible import clear_shapes, outline, visible_shapes


def compiled(world):
    return mujoco.MjModel.from_xml_string(
        "<mujoco><asset><material name='glass' rgba='1 1 1 0'/></asset>"
        f"<worldbody>{world}</worldbody></mujoco>"
    )


def named(world):
    model = compiled(world)
    return [model.geom(i).name for i in visible_shapes(model)]


def body(*geoms):
    shapes = "".join(f'<geom name="{name}" size="1" {rest}/>' for name, rest in geoms)
    return f"<body><freejoint/>{shapes}</body>"


HIDDEN = 'group="3"'


def test_what_is_drawn_hides_what_collides():
    assert named(body(("seen", 'group="2"'), ("touched", HIDDEN))) == ["seen"]


def test_what_collides_is_shown_only_of_a_robot_of_which_nothing_is_drawn():
    dressed = body(("seen", ""), ("a", HIDDEN)) + body(("b", HIDDEN))
    assert named(dressed) == ["seen"]
    assert named(body(("a", HIDDEN)) + body(("b", HIDDEN))) == ["a", "b"]


def test_floors_are_no_part_of_a_robot():
    floor = '<geom name="floor" type="plane" size="1 1 1"/>'
    assert named(floor + body(("seen", ""))) == ["seen"]
    assert named(floor) == []


def test_a_base_in_the_world_is_a_part_of_the_robot():
    assert named('<geom name="base" size="1"/>' + body(("seen", ""))) == ["base", "seen"]


def test_what_is_wholly_transparent_is_shown_only_if_there_is_nothing_else():
    clear = ("clear", 'rgba="1 1 1 0"')
    assert named(body(clear, ("seen", ""))) == ["seen"]
    assert named(body(("glass", 'material="glass"'), ("seen", ""))) == ["seen"]
    painted = ("painted", 'material="glass" rgba="1 0 0 1"')  # its own color counts
    assert named(body(painted, ("seen", ""))) == ["painted", "seen"]
    assert named(body(clear)) == ["clear"]
    model = compiled(body(clear, painted, ("glass", 'material="glass"')))
    assert clear_shapes(model) == [0, 2]


@pytest.mark.parametrize(
    ("shape", "reach"),
    [
        ('type="sphere" size="0.3"', (0.3, 0.3, 0.3)),
        ('type="box" size="0.1 0.2 0.3"', (0.1, 0.2, 0.3)),
        ('type="box" size="0.1 0.2 0.3" euler="90 0 0"', (0.1, 0.3, 0.2)),
        ('type="cylinder" size="0.1 0.4"', (0.1, 0.1, 0.4)),
        ('type="capsule" size="0.1 0.4"', (0.1, 0.1, 0.5)),
        ('type="capsule" size="0.1 0.4" euler="0 90 0"', (0.5, 0.1, 0.1)),
        ('type="ellipsoid" size="0.1 0.2 0.3"', (0.1, 0.2, 0.3)),
    ],
)
def test_the_outline_reaches_as_far_as_the_shape(shape, reach):
    model = compiled(f'<body pos="1 2 3"><freejoint/><geom {shape}/></body>')
    data = mujoco.MjData(model)
    mujoco.mj_kinematics(model, data)
    points = outline(model, data, [0])
    np.testing.assert_allclose(points.max(axis=0), np.add([1, 2, 3], reach), rtol=0, atol=1e-6)
    np.testing.assert_allclose(points.min(axis=0), np.subtract([1, 2, 3], reach), rtol=0, atol=1e-6)


def test_the_outline_of_a_mesh_is_its_corners():
    corners = "0 0 0  1 0 0  0 2 0  0 0 3"
    model = mujoco.MjModel.from_xml_string(
        f'<mujoco><asset><mesh name="m" vertex="{corners}"/></asset>'
        '<worldbody><geom type="mesh" mesh="m"/></worldbody></mujoco>'
    )
    data = mujoco.MjData(model)
    mujoco.mj_kinematics(model, data)
    points = outline(model, data, [0])
    np.testing.assert_allclose(points.min(axis=0), [0, 0, 0], atol=1e-6)
    np.testing.assert_allclose(points.max(axis=0), [1, 2, 3], atol=1e-6)


def test_of_nothing_there_is_no_outline():
    model = compiled("")
    assert outline(model, mujoco.MjData(model), []).shape == (0, 3)
