"""The written files have everything that moves the robot, and what they lack is named."""

import re

import mujoco
import pytest

from terrainkit_robots.analysis.facts import Facts
from terrainkit_robots.description.load import load_robot
from terrainkit_robots.onboarding.comparison import compare_models
from terrainkit_robots.onboarding.folder import write_files
from terrainkit_robots.onboarding.onboard_options import OnboardOptions
from terrainkit_robots.onboarding.pipeline import onboard
from terrainkit_robots.onboarding.source_model import load_source
from terrainkit_robots.onboarding.verify import verify
from tests.robots import QUADRUPED

SOURCE = """<mujoco model="m"><compiler angle="degree"/><worldbody><geom type="plane" size="1 1 1"/>
<body name="base" pos="0 0 1"><freejoint/><geom size="0.1" mass="3"/>
  <site name="hook" pos="0.1 0 0" euler="0 20 0"/>
  <body name="a" pos="0.1 0 0" gravcomp="0.5">
    <joint name="ja" axis="0 1 0" range="-40 40" ref="10" stiffness="3" springref="5" damping="1"/>
    <geom type="capsule" fromto="0 0 0 0.2 0 0" size="0.02" mass="0.4" friction="0.3 0.1 0.02"
      solref="0.01 1" condim="6"/>
    <body name="b" pos="0.2 0 0" euler="0 30 0">
      <joint name="jb" axis="0 1 0" range="-50 50" solreflimit="0.03 1" frictionloss="0.1"/>
      <geom type="box" size="0.1 0.02 0.02" pos="0.1 0 0" mass="0.3"/>
      <body name="plate" pos="0.2 0 0" euler="0 0 15"><geom size="0.02" mass="0.05"/>
        <site name="end" pos="0 0 0.01"/></body>
    </body>
  </body>
  <body name="f" pos="0 0.1 0"><joint name="jf" type="ball"/>
    <geom size="0.02" pos="0.01 0 -0.1" mass="0.1"/></body>
  <body name="c" pos="-0.1 0 0">
    <joint name="jc" axis="1 0 0" range="-60 60" springdamper="0.3 1"/>
    <geom size="0.05" pos="0 0 -0.1" mass="0.2"/>
    <body name="d" pos="0 0 -0.1"><joint name="jd" axis="0 0 1" range="-60 60" armature="0.01"/>
      <geom type="box" size="0.05 0.03 0.02" mass="0.2"/></body>
    <body name="e" pos="0 0 -0.2"><joint name="je" type="slide" range="-0.1 0.1"/>
      <geom size="0.03" mass="0.1"/></body>
  </body>
</body></worldbody>
<equality><connect body1="plate" body2="base" anchor="0 0 0.01" solref="0.05 1"/>
  <joint joint1="jd" joint2="jc" polycoef="0.1 0.5 0.2 0 0"/>
  <joint joint1="je" joint2="ja" polycoef="0 0.05 0 0 0"/>
  <tendon tendon1="cable" tendon2="sum" polycoef="0 0.1 0 0 0"/>
  {weld}</equality>
<tendon><spatial name="cable" stiffness="20" damping="2"><site site="hook"/><site site="end"/>
  </spatial><fixed name="sum" stiffness="4" range="-1 1"><joint joint="jb" coef="1"/>
  <joint joint="jc" coef="-2"/></fixed></tendon>
<actuator><position name="pa" joint="ja" kp="30" dampratio="0.7" ctrlrange="-1 1"
  forcerange="-20 20"/>
  <motor name="mb" joint="jb" gear="2" ctrlrange="-3 3"/></actuator></mujoco>"""
WELD = '<weld body1="e" body2="d" relpose="0 0 0.1 0.9 0.1 0 0" anchor="0 0.01 0" torquescale="2"/>'


@pytest.fixture(scope="module")
def written(tmp_path_factory):
    """A source, and the result of its onboarding."""
    folder = tmp_path_factory.mktemp("comparison")
    (folder / "m.xml").write_text(SOURCE.format(weld=WELD))
    options = OnboardOptions(render_images=False, force=True)
    return folder / "m.xml", onboard(folder / "m.xml", folder / "out", options)


def test_onboard_keeps_what_moves_the_robot(written):
    _, result = written
    assert result.verification.differences == ()
    model = mujoco.MjModel.from_xml_path(str(result.folder / "robot.xml"))
    assert (model.neq, model.ntendon) == (5, 2)


@pytest.mark.parametrize(
    ("pattern", "replacement", "named"),
    [
        (r"<connect [^>]*>", "", "constraints demand"),
        (r"<weld [^>]*>", "", "constraints demand"),
        (r'torquescale="2"', "", "constraints demand"),
        (r'solref="0.05 1"', "", "constraints demand"),
        (r'<joint joint1="jd"[^>]*>', "", "constraints demand"),
        (r'<tendon tendon1="cable"[^>]*>', "", "constraints demand"),
        (r'stiffness="20"', "", "springs, damping and actuators"),
        (r'springref="0\.087\d*"', "", "springs, damping and actuators"),
        (r'gravcomp="0.5"', "", "springs, damping and actuators"),
        (r'kp="30"', 'kp="31"', "springs, damping and actuators"),
        (r'mass="0.3', 'mass="0.302', "mass matrix"),
        (r'(<key name="home" qpos="[^"]* )[^ "]+', r"\g<1>0.09", "another keyframe of je"),
        (r'type="box" size="0.1', 'type="box" size="0.11', "contact parameters of 1 of"),
        (r'frictionloss="0.1"', "", "friction of jb"),
        (r'(name="jf_y"[^>]*axis=")0 1 0', r"\g<1>0 -1 0", "link rotation by"),
        (r'forcerange="-20 20"', 'forcerange="-30 30"', "effort limits of ja"),
        (r'friction="0.3 0.1 0.02"', "", "contact parameters of 1 of"),
        (r'name="jb"([^>]*)range="[^"]*"', r'name="jb"\1range="-1 1"', "limits of jb"),
    ],
)
def test_differences_are_named(written, pattern, replacement, named):
    source, result = written
    text, count = re.subn(pattern, replacement, (result.folder / "robot.xml").read_text(), count=1)
    assert count == 1
    found = differences(result, source, mujoco.MjModel.from_xml_string(text))
    assert any(named in phrase for phrase in found)


def differences(result, source, written):
    facts, model = result.robot.facts, load_source(Facts(load_robot(source)))
    compared = compare_models(
        "robot.xml", model, written, base="base", mass=facts.total_mass, pose=facts.default_pose
    )
    return compared.differences


@pytest.fixture(scope="module")
def quadruped(tmp_path_factory):
    folder = tmp_path_factory.mktemp("quadruped")
    return onboard(QUADRUPED, folder / "out", OnboardOptions(render_images=False))


@pytest.mark.parametrize(
    ("file", "pattern", "replacement", "named"),
    [
        ("robot.urdf", "0 0 -0.213", "0 0 -0.214", "link position by 1 mm at FL_foot"),
        # 2 atan(0.02 / 0.9998) is 2.29 degrees.
        (
            "robot.xml",
            'name="FL_calf" pos="[^"]*"',
            r'\g<0> quat="0.9998 0 0.02 0"',
            "link rotation by 2.3 deg at FL_calf",
        ),
        (
            "robot.urdf",
            '(name="FL_calf_joint".*?xyz=")0 1 0',
            r"\g<1>0 -1 0",
            "link rotation by 1.8e+02 deg at FL_calf",
        ),
        # 0.8 g of 15 kg are less than the tolerance of the total mass, but the calf is light.
        ("robot.xml", '"0.154"', '"0.1548"', "mass matrix by"),
        ("robot.urdf", "0.00548 -0.000975 -0.115", "0.00548 -0.000975 -0.125", "mass matrix by"),
        ("robot.urdf", '(FL_calf_joint".*?lower=")-', r"\1-1", "limits of FL_calf_joint"),
        ("robot.urdf", 'FL_calf_joint" type="[a-z]*', 'FL_calf_joint" type="fixed', "without the"),
    ],
)
def test_differences_of_each_file_are_named(tmp_path, quadruped, file, pattern, replacement, named):
    robot = quadruped.robot
    assert quadruped.verification.differences == ()
    text, count = re.subn(
        pattern, replacement, robot.files[file].decode(), count=1, flags=re.DOTALL
    )
    assert count == 1
    write_files(tmp_path, {**robot.files, file: text.encode()})
    found = verify(quadruped.report.facts, robot, tmp_path).differences
    assert found
    assert all(phrase.startswith(f"{file} differs from the source: ") for phrase in found)
    assert any(named in phrase for phrase in found)


def test_constraints_that_hold_the_robot_are_left_out(tmp_path):
    (tmp_path / "m.xml").write_text(SOURCE.format(weld='<weld name="rope" body1="base"/>'))
    assert load_robot(tmp_path / "m.xml").left_out == (
        "the constraint rope, which closes no loop of the robot",
    )


def test_joint_with_a_motor_is_no_mimic(tmp_path):
    source = SOURCE.format(weld="").replace(
        "</actuator>", '<motor name="me" joint="je"/></actuator>'
    )
    (tmp_path / "m.xml").write_text(source)
    robot = load_robot(tmp_path / "m.xml")
    assert [coupling.follower for coupling in robot.couplings] == ["jd", "je", "cable"]
    assert all(joint.mimic is None for joint in robot.joints)


def test_actuators_of_tendons_are_named(tmp_path, written):
    source, result = written
    text = source.read_text().replace("</actuator>", '<motor name="pull" tendon="sum"/></actuator>')
    (tmp_path / "m.xml").write_text(text)
    model = mujoco.MjModel.from_xml_path(str(result.folder / "robot.xml"))
    found = differences(result, tmp_path / "m.xml", model)
    assert found == ("without 1 actuator of tendons or bodies",)
