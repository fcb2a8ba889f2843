import mujoco
import pytest

from terrainkit_robots.analysis.facts import Facts
from terrainkit_robots.description.load import load_robot
from terrainkit_robots.lint.rule import get_rule, rules

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
    facts = Facts(load_robot(path))
    return [
        (rule.code, defect.severity or rule.severity, defect.subject)
        for rule in rules()
        if rule.family == "JNT" and (facts.legs or "legs" not in rule.needs)
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


def told(tmp_path, code, text):
    """Return the messages of one rule."""
    path = tmp_path / "r.urdf"
    path.write_text(text)
    return [defect.message for defect in get_rule(code).check(Facts(load_robot(path)))]


@pytest.mark.parametrize(("count", "words"), [(1, "a has a"), (2, "a, b have a")])
def test_one_joint_has_and_more_have_a_safety_controller(tmp_path, count, words):
    safety = '<safety_controller k_position="100" k_velocity="1"/>'
    joints = "".join(MIMIC.format(name=name, mimic=safety) for name in "ab"[:count])
    (message,) = told(tmp_path, "JNT014", CHAIN.format(joints=joints))
    assert message.startswith(words)


@pytest.mark.parametrize("kind", ["revolute", "prismatic"])
@pytest.mark.parametrize("limit", ['lower="-1"', 'upper="1"', 'lower="0"', 'upper="0"'])
def test_a_limit_with_one_end_is_none_in_mujoco(tmp_path, kind, limit):
    """MuJoCo takes one end for no limit, wherever it is: so it is an error wherever it is."""
    joint = MIMIC.format(name="a", mimic="").replace('lower="-1" upper="1"', limit)
    text = CHAIN.format(joints=joint.replace("revolute", kind))
    assert not mujoco.MjModel.from_xml_string(text).jnt_limited.any()
    (message,) = told(tmp_path, "JNT006", text)
    assert message.startswith(f"the {kind} joint a has ")
    assert [code for code, *_ in found(tmp_path / "r.urdf")] == ["JNT006"]
