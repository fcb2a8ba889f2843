import numpy as np
import pytest

from terrainkit_robots.lint.compare.body_masses import body_gap, dropped_mass, is_known, share
from terrainkit_robots.lint.compare.pairing import pair_robots


def gaps(one, other):
    pairing = pair_robots(one, other)
    return {a.name: body_gap(one, other, pairing, a, b) for a, b in pairing.bodies}


@pytest.mark.parametrize("name", ["quadruped", "biped"])
def test_a_urdf_and_its_mjcf_weigh_the_same_everywhere(robot_of, name):
    found = gaps(robot_of(f"{name}.urdf"), robot_of(f"{name}.xml"))
    assert len(found) == 13
    for gap in found.values():
        assert gap.mass < 1e-9
        assert gap.center < 1e-6
        assert gap.inertia < 1e-4


def test_a_difference_is_measured_and_is_that_of_one_body(robot_of):
    thigh = (
        '<inertial pos="-0.00374 -0.0223 -0.0327" mass="1.152"',
        '<inertial pos="-0.00374 -0.0223 -0.0227" mass="1.28"',
    )
    found = gaps(robot_of("quadruped.urdf"), robot_of("quadruped.xml", thigh))
    assert found["FL_thigh"].mass == pytest.approx(0.1)
    assert found["FL_thigh"].center == pytest.approx(0.01)
    assert found["FL_calf"].mass == pytest.approx(0.0)


def test_the_trunk_is_seen_from_the_same_link(robot_of):
    moments = 'ixx="1" iyy="2" izz="2.5" ixy="0" ixz="0" iyz="0"'
    inertial = f'<inertial><mass value="2"/><inertia {moments}/></inertial>'
    plain = f'<robot name="r"><link name="base">{inertial}</link></robot>'
    footed = plain.replace(
        '<link name="base">',
        '<link name="footprint"/><joint name="up" type="fixed"><parent link="footprint"/>'
        '<child link="base"/><origin xyz="0 0 0.3" rpy="0 0 1"/></joint><link name="base">',
    )
    (gap,) = gaps(robot_of(plain), robot_of(footed)).values()
    assert gap.center < 1e-12
    assert gap.inertia < 1e-12


def test_share():
    assert share(1.0, 1.0) == share(0.0, 0.0) == 0.0
    assert share(1.0, 2.0) == share(2.0, 1.0) == 0.5
    assert np.isnan(share(np.nan, 1.0))


def test_what_is_missing_or_hangs_on_a_mesh_is_not_known(robot_of):
    assert all(is_known(body) for body in robot_of("quadruped.urdf").bodies)
    bare = robot_of(
        '<robot name="r"><link name="a"><inertial><mass value="1"/></inertial></link></robot>'
    )
    assert not is_known(bare.bodies[0])
    meshed = robot_of(
        '<mujoco><asset><mesh name="m" file="m.stl"/></asset><worldbody>'
        '<body name="a"><geom type="mesh" mesh="m"/></body></worldbody></mujoco>'
    )
    assert not is_known(meshed.bodies[0])


FUSED = ('<compiler discardvisual="false" fusestatic="false"/>', "")


def test_what_mujoco_drops_of_a_urdf(robot_of):
    import mujoco

    from terrainkit_robots.quiet_mujoco import quiet_mujoco

    for robot in (robot_of("quadruped.urdf"), robot_of("quadruped.urdf", FUSED)):
        with quiet_mujoco():
            compiled = mujoco.MjModel.from_xml_path(str(robot.model.file))
        left = float(compiled.body_mass.sum())
        assert dropped_mass(robot) == pytest.approx(robot.total_mass - left)
    assert dropped_mass(robot) == pytest.approx(6.921)
    assert dropped_mass(robot_of("quadruped.xml")) == 0.0


def test_a_floating_joint_keeps_the_mass(robot_of):
    floating = (
        "<!-- Trunk and head.",
        '<link name="world"/><joint name="root" type="floating"><parent link="world"/>'
        '<child link="base"/></joint><!-- Trunk and head.',
    )
    assert dropped_mass(robot_of("quadruped.urdf", FUSED, floating)) == 0.0
