import math
from types import SimpleNamespace

import numpy as np
import pytest
import trimesh

from terrainkit_robots.description.model import Joint, Limit, Source
from terrainkit_robots.lint.check import lint_selected
from terrainkit_robots.lint.runner import lint
from terrainkit_robots.lint.settings import Settings
from terrainkit_robots.viewer.robot_scene import shape_surface
from terrainkit_robots.viewer.show_robot import (
    FindingPlaces,
    findings_html,
    show_robot,
    slider_range,
)
from tests.small_robots import ball, joint, link
from tests.tables import read_table


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
    slider = shown["FL_calf_joint [rad]"]  # of 1.885 rad, 500 times 0.0038
    assert (slider.min, slider.step) == pytest.approx((-2.7227, 0.001))
    assert slider.value == scene.facts.default_pose["FL_calf_joint"]
    slider.value = slider.max
    shown["default pose"].value = True
    assert slider.value == scene.facts.default_pose["FL_calf_joint"]
    shown["collision shapes"].value, shown["visual shapes"].value = True, False
    assert all(handle.visible for handle in scene.collisions)
    assert not any(handle.visible for handle in scene.visuals)
    # The feet touch the ground in the default pose.
    assert scene.base.position[2] == pytest.approx(scene.facts.stance.height)


def test_camera_sees_the_whole_robot(server, show, bundled, robot):
    scene, _ = show(bundled("quadruped.urdf"))
    points = np.array([frame.position for frame in scene.bodies]) + scene.base.position
    size, camera = np.linalg.norm(np.ptp(points, axis=0)), server.initial_camera
    assert size > 0.5
    np.testing.assert_allclose(camera.look_at, points.mean(axis=0))
    offset = np.subtract(camera.position, camera.look_at)
    np.testing.assert_allclose(offset, size * np.array([1.2, -1.2, 0.6]))
    show_robot(server, lint(robot('<robot name="r"><link name="a"/></robot>'), selected=()))
    np.testing.assert_allclose(camera.look_at, [0, 0, 0])
    np.testing.assert_allclose(camera.position, [0.6, -0.6, 0.3])


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


def test_mimic_joint_follows_without_slider(show, robot):
    scene, shown = show(robot("".join(GRIPPER)))
    assert "right_joint [m]" not in shown
    shown["left_joint [m]"].value = 0.03
    assert position(scene, "left") == pytest.approx([0.03, 0, 0])
    assert position(scene, "right") == pytest.approx([0.06, 0, 0])


def test_finding_is_listed_and_marked_at_its_link(show, bundled, tmp_path):
    facts = bundled(
        "quadruped.urdf", ('<mass value="6.921"/>', '<mass value="-6.921"/>'), tmp_path=tmp_path
    )
    report = lint_selected(facts, Settings(simulate=False))
    (finding, *_) = (each for each in report.findings if each.code == "INR002")
    body = facts.body_of[finding.subject]
    _, shown = show(facts)
    marked = f"/robot/body_{body.index}/finding_"
    labels = [name for name in shown if name.startswith(marked) and name.endswith("/codes")]
    (label,) = (name for name in labels if "INR002" in shown[name].text.split(", "))
    marker = shown[label.removesuffix("/codes")]
    farthest = max(np.linalg.norm(body.zero_pose[:3, 3]) for body in facts.bodies)
    assert (marker.color, marker.radius) == ((200, 40, 40), pytest.approx(0.05 * farthest))
    (listed,) = (name for name in shown if "INR002</b>" in name)
    assert finding.subject in listed


def test_findings_of_links_and_joints_have_a_place(bundled):
    facts = bundled("quadruped.urdf")
    index, locate = facts.body_of["FL_foot"].index, FindingPlaces(facts)

    def place(subject):
        return locate(SimpleNamespace(subject=subject, file=None, line=0))

    assert place("FL_foot") == (index, pytest.approx((0, 0, -0.213)))  # fixed to the calf
    assert place("FL_calf_joint") == (index, (0, 0, 0))
    assert place("robot") is None


def test_findings_escape_texts_of_the_file(robot):
    facts = robot('<robot name="r"><link name="&lt;img src=x&gt;"/></robot>')
    report = lint_selected(facts, Settings(simulate=False))
    assert any("<img" in finding.subject for finding in report.findings)
    assert "<img" not in findings_html(report.findings)


@pytest.mark.parametrize(
    ("limits", "expected"),
    [
        ((-1.0, 2.0), (-1.0, 2.0)),
        ((0.5, 2.0), (0.1, 2.0)),  # includes the position
        ((-49.9, 50.0), (-49.9, 50.0)),
        ((-50.0, 50.0), (-math.pi, math.pi)),
        ((None, None), (-math.pi, math.pi)),
    ],
)
def test_slider_range(limits, expected, tmp_path):
    source = Source(file=tmp_path, line=1)
    limit = Limit(source=source, lower=limits[0], upper=limits[1])
    joint = Joint(name="j", source=source, kind="revolute", parent="a", child="b", limit=limit)
    assert slider_range(joint, 0.1) == expected


SLIDE = {"kind": "prismatic", "axis": "1 0 0", "limits": (0, 0.08)}
GRIPPER = (
    '<robot name="gripper">',
    *(link(name, ball(0.02)) for name in ("palm", "left", "right")),
    joint("palm", "left", **SLIDE),
    joint("palm", "right", **SLIDE, more='<mimic joint="left_joint" multiplier="2"/>'),
    "</robot>",
)


@pytest.mark.parametrize(("shape", "size", "upper"), read_table(__file__, "surfaces_of_shapes"))
def test_surfaces_of_shapes(shape, size, upper):
    points = shape_surface(SimpleNamespace(shape=shape, size=size), None).points
    np.testing.assert_allclose(points.max(axis=0), upper, rtol=0.01)
    np.testing.assert_allclose(points.min(axis=0), np.negative(upper), rtol=0.01)


def test_colors_of_shapes(show, robot):
    ball = '<geometry><sphere radius="0.1"/></geometry>'
    paint = '<material name="m"><color rgba="1 0.5 0.1 1"/></material>'
    shapes = f"<visual>{ball}{paint}</visual><visual>{ball}</visual><collision>{ball}</collision>"
    scene, _ = show(robot(f'<robot name="r"><link name="a">{shapes}</link></robot>'))
    (collision,) = scene.collisions
    assert [each.color for each in scene.visuals] == [(255, 127, 25), (184, 189, 199)]
    assert (collision.color, collision.opacity, collision.visible) == ((230, 120, 40), 0.5, False)
    assert [each.opacity for each in scene.visuals] == [None, None]
    assert scene.base.position == pytest.approx([0, 0, 0.1])


def test_meshes_are_shown_if_they_can_be_read(show, robot, tmp_path):
    trimesh.creation.box((1, 2, 3)).export(tmp_path / "box.stl")
    mesh = '<visual><geometry><mesh filename="{}.stl" scale="2 2 2"/></geometry></visual>'
    link = f'<link name="a">{mesh.format("box")}{mesh.format("gone")}</link>'
    scene, _ = show(robot(f'<robot name="r">{link}</robot>'))
    (shown,) = scene.visuals
    assert shown.vertices.max(axis=0) == pytest.approx([1, 2, 3])
