import math

import numpy as np
import pytest

from terrainkit_robots.description.model import Joint, Limit, Source
from terrainkit_robots.lint.check import check_robot
from terrainkit_robots.lint.runner import lint
from terrainkit_robots.lint.selection import lint_selected
from terrainkit_robots.lint.settings import Settings
from terrainkit_robots.viewer.show_robot import findings_html, show_robot, slider_range


@pytest.fixture
def show(server, shown):
    def run(facts):
        return show_robot(server, lint_selected(facts, Settings(simulate=False))), shown

    return run


def position(scene, body):
    """Return the position of the frame of a body in the frame of the trunk."""
    (index,) = (k for k, each in enumerate(scene.facts.bodies) if each.name == body)
    return np.array(scene.bodies[index].position)


def test_show_robot_adds_meshes_and_sliders(show, bundled):
    scene, shown = show(bundled("quadruped.urdf"))
    assert len(scene.bodies) == 13
    assert all(handle.visible for handle in scene.visuals)
    assert not any(handle.visible for handle in scene.collisions)
    assert len(scene.visuals) > 13
    assert shown["FL_calf_joint [rad]"].min == pytest.approx(-2.7227)
    assert shown["FL_calf_joint [rad]"].value == scene.facts.default_pose["FL_calf_joint"]
    # The feet touch the ground in the default pose.
    assert scene.base.position[2] == pytest.approx(scene.facts.stance.height)


def test_slider_moves_joint(show, bundled):
    scene, shown = show(bundled("quadruped.urdf"))
    shown["FL_thigh_joint [rad]"].value = 0.0
    shown["FL_hip_joint [rad]"].value = 0.0
    hip, calf = position(scene, "FL_thigh"), position(scene, "FL_calf")
    (calf_joint,) = (j for j in scene.facts.joints if j.name == "FL_calf_joint")
    # Without rotations, the calf is at its origin in the file.
    np.testing.assert_allclose(calf - hip, calf_joint.origin[:3, 3], atol=1e-6)
    shown["FL_thigh_joint [rad]"].value = math.pi / 2  # about y: what was below is behind
    x, y, z = calf_joint.origin[:3, 3]
    np.testing.assert_allclose(position(scene, "FL_calf") - hip, (z, y, -x), atol=1e-6)


def test_mirrored_joints_move_together_if_checked(show, bundled):
    scene, shown = show(bundled("quadruped.urdf"))
    left, right = shown["FL_hip_joint [rad]"], shown["FR_hip_joint [rad]"]
    before = right.value
    left.value = 0.2
    assert right.value == before
    shown["move mirrored joints"].value = True
    left.value = 0.3
    assert right.value == pytest.approx(-0.3)
    mirrored = position(scene, "FR_calf") * [1, -1, 1]
    shown["FL_thigh_joint [rad]"].value = shown["FR_thigh_joint [rad]"].value
    np.testing.assert_allclose(position(scene, "FL_calf"), mirrored, atol=1e-6)


def test_default_pose_button_resets_sliders(show, bundled):
    scene, shown = show(bundled("biped.urdf"))
    name = "left_knee_joint"
    slider, default = shown[f"{name} [rad]"], scene.facts.default_pose[name]
    slider.value = slider.max
    shown["default pose"].value = True
    assert slider.value == default


def test_mimic_joint_follows_without_slider(show, robot):
    scene, shown = show(robot(GRIPPER))
    assert "right [m]" not in shown
    shown["left [m]"].value = 0.03
    assert position(scene, "left_finger") == pytest.approx([0.03, 0, 0])
    assert position(scene, "right_finger") == pytest.approx([0.06, 0, 0])


def test_checkbox_shows_collision_shapes(show, bundled):
    scene, shown = show(bundled("quadruped.xml"))
    shown["collision shapes"].value = True
    assert all(handle.visible for handle in scene.collisions)
    shown["visual shapes"].value = False
    assert not any(handle.visible for handle in scene.visuals)


def test_finding_is_listed_and_marked_at_its_link(show, bundled, tmp_path):
    facts = bundled(
        "quadruped.urdf", ('<mass value="6.921"/>', '<mass value="-6.921"/>'), tmp_path=tmp_path
    )
    report = lint_selected(facts, Settings(simulate=False))
    (finding, *_) = (each for each in report.findings if each.code == "INR002")
    body = facts.body_of[finding.subject]
    _, shown = show(facts)
    codes = [
        h.text
        for name, h in shown.items()
        if name.endswith("/codes") and f"body_{body.index}/" in name
    ]
    assert any("INR002" in text for text in codes)
    (listed,) = (name for name in shown if "INR002</b>" in name)
    assert finding.subject in listed


def test_findings_escape_texts_of_the_file(robot):
    facts = robot('<robot name="r"><link name="&lt;img src=x&gt;"/></robot>')
    report = lint_selected(facts, Settings(simulate=False))
    assert any("<img" in finding.subject for finding in report.findings)
    assert "<img" not in findings_html(report.findings)


def test_show_robot_without_findings_or_shapes(server, robot):
    show_robot(server, lint(robot('<robot name="r"><link name="a"/></robot>'), selected=()))


@pytest.mark.parametrize("name", ["go2/urdf/go2.urdf", "h1/h1.xml"])
def test_show_robot_with_meshes(server, robot_file, name):
    report = check_robot(robot_file(name))
    scene = show_robot(server, report)
    assert len(scene.visuals) >= len(report.facts.bodies)


@pytest.mark.parametrize(
    ("limits", "expected"),
    [
        ((-1.0, 2.0), (-1.0, 2.0)),
        ((0.5, 2.0), (0.1, 2.0)),  # includes the position
        ((-1e10, 1e10), (-math.pi, math.pi)),
        ((None, None), (-math.pi, math.pi)),
    ],
)
def test_slider_range(limits, expected, tmp_path):
    source = Source(file=tmp_path, line=1)
    limit = Limit(source=source, lower=limits[0], upper=limits[1])
    joint = Joint(name="j", source=source, kind="revolute", parent="a", child="b", limit=limit)
    assert slider_range(joint, 0.1) == expected


FINGER = """<link name="{0}_finger"><inertial><mass value="0.1"/>
    <inertia ixx="1e-4" iyy="1e-4" izz="1e-4" ixy="0" ixz="0" iyz="0"/></inertial>
    <collision><geometry><sphere radius="0.02"/></geometry></collision></link>
  <joint name="{0}" type="prismatic"><parent link="palm"/><child link="{0}_finger"/>
    <axis xyz="1 0 0"/><limit lower="0" upper="0.08" effort="9" velocity="1"/>{1}</joint>"""
MIMIC = '<mimic joint="left" multiplier="2"/>'
GRIPPER = f"""<robot name="gripper"><link name="palm"/>
  {FINGER.format("left", "")} {FINGER.format("right", MIMIC)}</robot>"""
