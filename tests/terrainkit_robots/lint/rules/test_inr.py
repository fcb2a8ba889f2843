import re

import mujoco
import numpy as np
import pytest

from terrainkit_robots.analysis.facts import Facts
from terrainkit_robots.analysis.inertia.physical import triangle_ratio
from terrainkit_robots.description.load import load_robot
from terrainkit_robots.lint.rule import get_rule, rules
from terrainkit_robots.mesh.mesh_cache import Meshes
from tests.robots import BUNDLED

ROBOTS = [
    *BUNDLED,
    "a1/urdf/a1.urdf",
    "go2/urdf/go2.urdf",
    "go2_mjcf/go2.xml",
    "h1/urdf/h1.urdf",
    "h1/h1.xml",
    "g1/g1_29dof.urdf",
    "g1/g1_29dof.xml",
]

ARM = """<robot name="arm">
  <link name="base"/>
  <joint name="turn" type="revolute">
    <parent link="base"/><child link="tip"/>
    <axis xyz="0 0 1"/><limit lower="-1" upper="1" effort="10" velocity="5"/>
  </joint>
  <link name="tip">
    <inertial><origin xyz="0 0 0.2"/><mass value="{mass}"/>
      <inertia ixx="{ixx}" ixy="0" ixz="0" iyy="{iyy}" iyz="0" izz="{izz}"/></inertial>
    <collision><origin xyz="0 0 0.2"/><geometry><box size="0.06 0.08 0.4"/></geometry></collision>
  </link>
  {more}
</robot>"""
DEFAULTS = {"mass": 1, "ixx": 0.014, "iyy": 0.0136, "izz": 0.0008, "more": ""}


class RecordingMeshes(Meshes):
    """Mesh files that record which of them are read."""

    def __init__(self):
        super().__init__()
        self.requested = set()

    def vertices(self, mesh):
        self.requested.add(mesh.filename)
        return super().vertices(mesh)


def check(path, meshes=None):
    """Return code, severity and subject of the errors and warnings of the INR rules."""
    facts = Facts(load_robot(path), meshes)
    return [
        (rule.code, violation.severity, violation.subject)
        for rule in rules()
        if rule.family == "INR"
        for violation in rule.findings(facts)
        if violation.severity != "note"
    ]


@pytest.fixture
def arm(tmp_path):
    def write(**changed):
        path = tmp_path / "arm.urdf"
        path.write_text(ARM.format(**DEFAULTS | changed))
        return path

    return write


@pytest.mark.parametrize("name", ROBOTS)
def test_inr_accepts_published_robots(robot_file, name):
    # The covers of the calves have shapes but no mass, so MuJoCo adds 1.3 % of the total mass.
    known = [("INR011", "warning", "FL_calflower")] if name == "go2/urdf/go2.urdf" else []
    assert check(robot_file(name)) == known


def test_the_real_defects_of_anymal_c_are_check(robot_file):
    cameras = [f"depth_camera_{side}_camera" for side in ("front", "rear", "left", "right")]
    assert check(robot_file("anymal_c/urdf/anymal_c.urdf")) == [
        ("INR003", "error", "hatch"),
        *(("INR004", "error", camera) for camera in cameras),
    ]


def test_the_real_defects_of_cassie_are_check(robot_file):
    assert check(robot_file("cassie/urdf/cassie.urdf")) == [
        ("INR001", "warning", "left_pelvis_abduction"),
        ("INR003", "error", "base"),
        ("INR004", "error", "left_toe"),
        ("INR004", "error", "right_toe"),
    ]


def test_massless_body_lists_links_of_cassie(robot_file):
    facts = Facts(load_robot(robot_file("cassie/urdf/cassie.urdf")))
    rule = next(rule for rule in rules() if rule.code == "INR001")
    (violation,) = rule.findings(facts)
    assert violation.severity == "warning"
    assert "left_pelvis_abduction, right_pelvis_abduction" in violation.message


def test_inr_reads_no_visual_mesh(arm):
    meshes = RecordingMeshes()
    path, shell = arm(), '<visual><geometry><mesh filename="shell.stl"/></geometry></visual></link>'
    path.write_text(path.read_text().replace("</collision>\n  </link>", f"</collision>{shell}"))
    facts = Facts(load_robot(path))
    assert [mesh.filename for link in facts.links for mesh in meshes_of(link)] == ["shell.stl"]
    check(path, meshes)
    assert meshes.requested == set()


def meshes_of(link):
    return [shape.mesh for shape in (*link.visuals, *link.collisions) if shape.mesh]


@pytest.mark.parametrize(
    ("factor", "code", "severity"),
    [
        (1e3, "INR006", "error"),
        (1e6, "INR006", "error"),
        (40.0, "INR006", "error"),
        (5.0, "INR006", "warning"),
        (3.0, None, None),
        (0.3, None, None),
        (0.01, None, None),
        (1e-3, "INR007", "warning"),
        (1e-6, "INR007", "warning"),
    ],
)
def test_inertia_with_wrong_units(arm, factor, code, severity):
    scaled = {name: DEFAULTS[name] * factor for name in ("ixx", "iyy", "izz")}
    assert check(arm(**scaled)) == ([] if code is None else [(code, severity, "tip")])


@pytest.mark.parametrize(
    ("mass", "code"),
    [(1000.0, "INR010"), (50.0, "INR010"), (20.0, None), (0.05, None), (0.001, "INR010")],
)
def test_mass_with_wrong_units(arm, mass, code):
    scaled = {name: DEFAULTS[name] * mass for name in ("ixx", "iyy", "izz")}
    assert check(arm(mass=mass, **scaled)) == ([] if code is None else [(code, "warning", "tip")])


@pytest.mark.parametrize("digits", [3, 4, 5, 6])
def test_triangle_inequality_tolerates_rounding(arm, digits):
    rng = np.random.default_rng(0)
    for _ in range(20):
        a, b = rng.uniform(0.1, 1.0, 2) * 1e-2
        moments = {"ixx": a, "iyy": b, "izz": a + b}
        rounded = {name: f"{value:.{digits}g}" for name, value in moments.items()}
        ratio = triangle_ratio(np.sort([float(text) for text in rounded.values()]))
        codes = {code for code, *_ in check(arm(mass=5, **rounded))}
        assert ("INR004" in codes) == (ratio < 0.999)
        assert ratio > 0.999 or digits == 3


def test_inertia_rules_agree_with_mujoco(arm):
    rng = np.random.default_rng(1)
    rejected = 0
    for _ in range(60):
        moments = dict(zip(("ixx", "iyy", "izz"), rng.uniform(-0.002, 0.014, 3), strict=True))
        path = arm(**moments)
        try:
            mujoco.MjModel.from_xml_path(str(path))
            valid = True
        except ValueError:
            valid = False
        rejected += not valid
        codes = {code for code, *_ in check(path)}
        assert bool(codes & {"INR003", "INR004"}) != valid, moments
    assert 10 < rejected < 50


def test_inferred_mass_agrees_with_mujoco(arm):
    hood = """<joint name="mount" type="fixed"><parent link="tip"/><child link="hood"/></joint>
      <link name="hood">
        <collision><geometry><cylinder radius="0.03" length="0.1"/></geometry></collision>
        <collision><geometry><sphere radius="0.02"/></geometry></collision>
      </link>"""
    path = arm(mass=1, more=hood)
    compiled = mujoco.MjModel.from_xml_path(str(path))
    facts = Facts(load_robot(path))
    rule = next(rule for rule in rules() if rule.code == "INR011")
    (violation,) = rule.findings(facts)
    assert violation.measured["added"] == pytest.approx(compiled.body_mass.sum() - 1.0)
    assert re.search(r"got 0\.316 kg, 31\.6% of the declared 1 kg", violation.message)


@pytest.mark.parametrize(
    ("old", "new", "message"),
    [
        (' iyy="0.0136"', "", "<inertia> without iyy; expected ixx, iyy and izz"),
        (' ixx="0.014"', "", "<inertia> without ixx; expected "),
        ("<inertia ", "<unknown ", "no <inertia>; expected <inertia>"),
    ],
)
def test_inertia_names_missing_elements(arm, old, new, message):
    path = arm()
    path.write_text(path.read_text().replace(old, new))
    (violation,) = get_rule("INR003").findings(Facts(load_robot(path)))
    assert f"inertia of link tip (mass 1 kg): got {message}" in violation.message


def test_inertia_names_mjcf_attributes(tmp_path):
    path = tmp_path / "robot.xml"
    path.write_text(
        '<mujoco><worldbody><body name="a"><freejoint/><inertial pos="0 0 0" mass="1"/>'
        '<body name="b"><joint/><inertial pos="0 0 0" mass="1" diaginertia="1 1 1"/></body>'
        '<body name="c"><joint/><inertial pos="0 0 0" mass="1"/></body></body></worldbody></mujoco>'
    )
    violations = {
        violation.subject: violation
        for violation in get_rule("INR003").findings(Facts(load_robot(path)))
    }
    assert "c" in violations
    assert "neither diaginertia nor fullinertia" in violations["c"].message
