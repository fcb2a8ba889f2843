import mujoco
import numpy as np
import pytest

from terrainkit_robots.analysis.facts import Facts
from terrainkit_robots.description.load import load_robot
from terrainkit_robots.export.canonical import to_canonical
from terrainkit_robots.export.mjcf import Extras, mjcf_text
from terrainkit_robots.export.urdf import urdf_text
from terrainkit_robots.quiet_mujoco import quiet_mujoco

TRUNK = '<mass value="60"/><inertia ixx="1.5" iyy="8.5" izz="9.2" ixy="0" ixz="0" iyz="0"/>'
NOTHING = '<mass value="{}"/><inertia ixx="0" iyy="0" izz="0" ixy="0" ixz="0" iyz="0"/>'
TURNED = '<origin xyz="0.1 0 0.2" rpy="0.3 0.5 0.7"/>'


def facts(tmp_path, links, joints=""):
    inside = "".join(
        f'<link name="{name}"><inertial>{inertial}</inertial></link>'
        for name, inertial in links.items()
    )
    path = tmp_path / "robot.urdf"
    path.write_text(f'<robot name="r">{inside}{joints}</robot>')
    return Facts(load_robot(path))


def fixed(parent, child):
    return (
        f'<joint name="{child}_joint" type="fixed"><parent link="{parent}"/>'
        f'<child link="{child}"/>{TURNED}</joint>'
    )


def compiled(form):
    """Return what MuJoCo makes of both files."""
    with quiet_mujoco():
        return [
            mujoco.MjModel.from_xml_string(text)
            for text in (urdf_text(form.model), mjcf_text(form.model, Extras()))
        ]


def test_sensor_mass_moves_to_trunk(tmp_path):
    robot = facts(tmp_path, {"trunk": TRUNK, "imu": NOTHING.format(0.5)}, fixed("trunk", "imu"))
    form = to_canonical(robot, floating=True)
    _, imu = form.model.links
    assert imu.inertial is None
    assert form.changes == (
        "moved the mass of imu to trunk, to which they are fixed: MuJoCo rejects masses without "
        "inertia",
    )
    (before,), (after,) = robot.bodies, Facts(form.model).bodies
    assert after.mass == pytest.approx(60.5)
    assert np.allclose(after.center, before.center)
    assert np.allclose(after.inertia, before.inertia)
    assert [model.body_mass.sum() for model in compiled(form)] == pytest.approx([60.5] * 2)


def test_heaviest_link_gets_mass(tmp_path):
    robot = facts(tmp_path, {"base": NOTHING.format(1e-6), "trunk": TRUNK}, fixed("base", "trunk"))
    form = to_canonical(robot, floating=True)
    base, trunk = form.model.links
    assert base.inertial is None
    assert trunk.inertial.mass == pytest.approx(60 + 1e-6)
    assert np.allclose(Facts(form.model).bodies[0].inertia, robot.bodies[0].inertia)
    compiled(form)


def test_rotated_and_rounded_plate(tmp_path):
    plate = f'{TURNED}<mass value="2"/>' + (
        '<inertia ixx="0.010004" iyy="0.02" izz="0.03001" ixy="0" ixz="0" iyz="0"/>'
    )
    robot = facts(tmp_path, {"plate": plate})
    form = to_canonical(robot, floating=True)
    assert not form.changes
    before, after = robot.bodies[0].principal, Facts(form.model).bodies[0].principal
    assert after == pytest.approx(before, rel=1e-3)
    compiled(form)


def test_invalid_body_is_unchanged(tmp_path):
    wrong = '<mass value="2"/><inertia ixx="0.01" iyy="0.01" izz="1" ixy="0" ixz="0" iyz="0"/>'
    robot = facts(tmp_path, {"a": wrong, "b": NOTHING.format(1)}, fixed("a", "b"))
    form = to_canonical(robot, floating=True)
    assert not form.changes
    assert [link.inertial.mass for link in form.model.links] == [2, 1]
    assert form.model.links[0].inertial.inertia[2, 2] == 1


NONE = '<mass value="{}"/>'


def test_missing_inertia_is_zero(tmp_path):
    forms = [
        to_canonical(facts(tmp_path, {"trunk": TRUNK, "imu": imu}, fixed("trunk", "imu")))
        for imu in (NONE.format(0.5), NOTHING.format(0.5))
    ]
    for form in forms:
        assert form.model.links[1].inertial is None
        assert form.changes == forms[0].changes
        assert "moved the mass of imu to trunk" in form.changes[0]
    bodies = [Facts(form.model).bodies[0] for form in forms]
    np.testing.assert_array_equal(bodies[0].inertia, bodies[1].inertia)
    assert bodies[0].mass == pytest.approx(60.5)
    compiled(forms[0])


def test_single_mass_without_inertia(tmp_path):
    joint = """<joint name="j" type="continuous"><parent link="base"/><child link="arm"/>
      <axis xyz="0 1 0"/></joint>"""
    robot = facts(tmp_path, {"base": NONE.format(5), "arm": TRUNK}, joint)
    form = to_canonical(robot, floating=False)
    assert form.changes == ()
    np.testing.assert_array_equal(form.model.links[0].inertial.inertia, np.zeros((3, 3)))
    assert 'mass value="5"/>\n      <inertia ixx="0" ixy="0"' in urdf_text(form.model)
    for model in compiled(form):
        assert model.body_mass.sum() == pytest.approx(65)
        assert not model.body("base").inertia.any()


@pytest.mark.parametrize(
    ("iyy", "expected"),
    [
        # (ixx + iyy) / izz is 0.9933, 0.9867 and 1.0033; the limit is 0.99.
        (0.0198, (0.0101, 0.0199, 0.03)),
        (0.0196, (0.01, 0.0196, 0.03)),
        (0.0201, (0.01, 0.0201, 0.03)),
    ],
)
def test_only_small_violations_are_rounding(tmp_path, iyy, expected):
    inertia = f'<inertia ixx="0.01" iyy="{iyy}" izz="0.03" ixy="0" ixz="0" iyz="0"/>'
    robot = facts(tmp_path, {"plate": f'<mass value="2"/>{inertia}'})
    (plate,) = to_canonical(robot, floating=True).model.links
    assert np.diag(plate.inertial.inertia) == pytest.approx(expected, abs=1e-7)
