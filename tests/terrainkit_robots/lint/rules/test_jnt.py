import mujoco
import pytest

from terrainkit_robots.analysis.facts import Facts
from terrainkit_robots.description.load import load_robot
from terrainkit_robots.lint.rule import get_rule, rules
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
    "cassie/urdf/cassie.urdf",
]


def check(path):
    """Return code, severity and subject of the errors and warnings of the JNT rules."""
    facts = Facts(load_robot(path))
    return [
        (rule.code, violation.severity, violation.subject)
        for rule in rules()
        if rule.family == "JNT" and (facts.legs or "legs" not in rule.needs)
        for violation in rule.findings(facts)
        if violation.severity != "note"
    ]


@pytest.mark.parametrize("name", ROBOTS)
def test_jnt_accepts_published_robots(robot_file, name):
    assert check(robot_file(name)) == []


def test_missing_limits_of_anymal_c(robot_file):
    joints = [
        f"{leg}_{joint}" for leg in ("LF", "RF", "LH", "RH") for joint in ("HAA", "HFE", "KFE")
    ]
    assert check(robot_file("anymal_c/urdf/anymal_c.urdf")) == [
        ("JNT006", "error", joint) for joint in joints
    ]


CHAIN = """<robot name="r">
  <link name="base"/>
  {joints}
</robot>"""
MIMIC = """<joint name="{name}" type="revolute">
    <parent link="base"/><child link="{name}_link"/><axis xyz="0 0 1"/>
    <limit lower="-1" upper="1" effort="1" velocity="1"/>{mimic}
  </joint><link name="{name}_link"><inertial><mass value="1"/>
    <inertia ixx="1e-3" ixy="0" ixz="0" iyy="1e-3" iyz="0" izz="1e-3"/></inertial></link>"""


def check_mimic(tmp_path, **targets):
    joints = [
        MIMIC.format(name=name, mimic=f'<mimic joint="{target}"/>' if target else "")
        for name, target in targets.items()
    ]
    path = tmp_path / "r.urdf"
    path.write_text(CHAIN.format(joints="".join(joints)))
    return [(code, subject) for code, _, subject in check(path)]


def test_mimic_accepts_chain(tmp_path):
    assert check_mimic(tmp_path, a="b", b="c", c="") == []


def test_mimic_reports_cycle_once(tmp_path):
    assert check_mimic(tmp_path, a="b", b="c", c="a") == [("JNT013", "a")]


def test_mimic_cycle_excludes_joints_before_it(tmp_path):
    assert check_mimic(tmp_path, a="b", b="c", c="b") == [("JNT013", "b")]


def test_mimic_checks_long_chain_fast(tmp_path):
    names = {f"j{k}": f"j{k + 1}" for k in range(300)} | {"j300": ""}
    assert check_mimic(tmp_path, **names) == []


def messages(tmp_path, code, text):
    """Return the messages of one rule."""
    path = tmp_path / "r.urdf"
    path.write_text(text)
    return [violation.message for violation in get_rule(code).findings(Facts(load_robot(path)))]


@pytest.mark.parametrize(("count", "listed"), [(1, "a"), (2, "a, b")])
def test_safety_controller_lists_joints(tmp_path, count, listed):
    safety = '<safety_controller k_position="100" k_velocity="1"/>'
    joints = "".join(MIMIC.format(name=name, mimic=safety) for name in "ab"[:count])
    (message,) = messages(tmp_path, "JNT014", CHAIN.format(joints=joints))
    assert message.startswith(f"safety_controller of {listed}: ")


@pytest.mark.parametrize("kind", ["revolute", "prismatic"])
@pytest.mark.parametrize("limit", ['lower="-1"', 'upper="1"', 'lower="0"', 'upper="0"'])
def test_limit_with_one_end_is_unlimited(tmp_path, kind, limit):
    """MuJoCo applies no limit if one end is missing, so that JNT006 is an error."""
    joint = MIMIC.format(name="a", mimic="").replace('lower="-1" upper="1"', limit)
    text = CHAIN.format(joints=joint.replace("revolute", kind))
    assert not mujoco.MjModel.from_xml_string(text).jnt_limited.any()
    (message,) = messages(tmp_path, "JNT006", text)
    assert message.startswith(f"limits of {kind} joint a: got ")
    assert [code for code, *_ in check(tmp_path / "r.urdf")] == ["JNT006"]
