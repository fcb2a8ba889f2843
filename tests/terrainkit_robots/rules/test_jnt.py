import pytest

from terrainkit_robots.facts import Facts
from terrainkit_robots.robot_file import read_robot
from terrainkit_robots.rule import rules

HEALTHY = [
    "a1/urdf/a1.urdf",
    "go2/urdf/go2.urdf",
    "go2_mjcf/go2.xml",
    "h1/urdf/h1.urdf",
    "h1/h1.xml",
    "g1/g1_29dof.urdf",
    "g1/g1_29dof.xml",
    "cassie/urdf/cassie.urdf",
]


def found(path):
    """Return code, severity and subject of what JNT finds that is more than information."""
    facts = Facts(read_robot(path))
    return [
        (rule.code, defect.severity or rule.severity, defect.subject)
        for rule in rules()
        if rule.family == "JNT" and (facts.legs or not rule.legged)
        for defect in rule.check(facts)
        if (defect.severity or rule.severity) != "info"
    ]


@pytest.mark.parametrize("name", HEALTHY)
def test_healthy_robots_have_sound_joints(robot_file, name):
    assert found(robot_file(name)) == []


def test_anymal_c_has_twelve_joints_without_limits(robot_file):
    joints = [
        f"{leg}_{joint}" for leg in ("LF", "RF", "LH", "RH") for joint in ("HAA", "HFE", "KFE")
    ]
    left = found(robot_file("anymal_c/urdf/anymal_c.urdf"))
    assert left == [("JNT006", "error", joint) for joint in joints]


CHAIN = """<robot name="r">
  <link name="base"/>
  {joints}
</robot>"""
MIMIC = """<joint name="{name}" type="revolute">
    <parent link="base"/><child link="{name}_link"/><axis xyz="0 0 1"/>
    <limit lower="-1" upper="1" effort="1" velocity="1"/>{mimic}
  </joint><link name="{name}_link"><inertial><mass value="1"/>
    <inertia ixx="1e-3" ixy="0" ixz="0" iyy="1e-3" iyz="0" izz="1e-3"/></inertial></link>"""


def mimics(tmp_path, **targets):
    joints = [
        MIMIC.format(name=name, mimic=f'<mimic joint="{target}"/>' if target else "")
        for name, target in targets.items()
    ]
    path = tmp_path / "r.urdf"
    path.write_text(CHAIN.format(joints="".join(joints)))
    return [(code, subject) for code, _, subject in found(path)]


def test_a_chain_of_mimics_is_sound(tmp_path):
    assert mimics(tmp_path, a="b", b="c", c="") == []


def test_a_circle_of_mimics_is_told_once(tmp_path):
    assert mimics(tmp_path, a="b", b="c", c="a") == [("JNT013", "a")]


def test_what_leads_into_a_circle_is_no_circle(tmp_path):
    assert mimics(tmp_path, a="b", b="c", c="b") == [("JNT013", "b")]


def test_a_long_chain_of_mimics_does_not_take_long(tmp_path):
    names = {f"j{k}": f"j{k + 1}" for k in range(300)} | {"j300": ""}
    assert mimics(tmp_path, **names) == []
