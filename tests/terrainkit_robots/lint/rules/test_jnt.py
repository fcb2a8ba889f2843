import mujoco
import pytest

from terrainkit_robots.analysis.facts import Facts
from terrainkit_robots.description.load import load_robot
from terrainkit_robots.lint.rule import get_rule
from tests import small_robots
from tests.small_robots import link


def joint(name, more="", *, kind="revolute", limit='lower="-1" upper="1"'):
    more += f'<limit {limit} effort="1" velocity="1"/>'
    moved = link(f"{name}_link") + small_robots.joint("base", f"{name}_link", kind=kind, more=more)
    return moved.replace(f"{name}_link_joint", name)


@pytest.fixture
def check(tmp_path):
    """Return a function that returns the violations of a rule on joints of a fixed link."""

    def run(code, *joints):
        path = tmp_path / "r.urdf"
        path.write_text(f'<robot name="r"><link name="base"/>{"".join(joints)}</robot>')
        return list(get_rule(code).findings(Facts(load_robot(path))))

    return run


@pytest.mark.parametrize(
    ("targets", "subjects"),
    [
        ({"a": "b", "b": "c", "c": ""}, []),
        ({"a": "b", "b": "c", "c": "a"}, ["a"]),
        ({"a": "b", "b": "c", "c": "b"}, ["b"]),  # the joint before the cycle is not in it
        ({f"j{k}": f"j{k + 1}" for k in range(300)} | {"j300": ""}, []),
    ],
    ids=["chain", "cycle", "before a cycle", "long chain"],
)
def test_cycles_of_mimic_joints_are_found_once(check, targets, subjects):
    joints = [joint(a, f'<mimic joint="{b}"/>' if b else "") for a, b in targets.items()]
    assert [violation.subject for violation in check("JNT013", *joints)] == subjects


@pytest.mark.parametrize("kind", ["revolute", "prismatic"])
@pytest.mark.parametrize("limit", ['lower="-1"', 'upper="1"', 'lower="0"', 'upper="0"'])
def test_limit_with_one_end_is_unlimited_in_mujoco(check, tmp_path, kind, limit):
    (violation,) = check("JNT006", joint("a", kind=kind, limit=limit))
    assert violation.message.startswith(f"limits of {kind} joint a: got ")
    assert not mujoco.MjModel.from_xml_path(str(tmp_path / "r.urdf")).jnt_limited.any()
