import re
import subprocess
import sys

import pytest

from terrainkit_robots.analysis.facts import Facts
from terrainkit_robots.lint.rule import rules
from terrainkit_robots.lint.runner import lint

XRF = [rule for rule in rules() if "against" in rule.needs]


@pytest.mark.parametrize("name", ["quadruped", "biped"])
@pytest.mark.parametrize("suffixes", [(".urdf", ".xml"), (".xml", ".urdf")])
def test_bundled_robots_agree(robot_of, name, suffixes):
    one, other = (robot_of(name + suffix) for suffix in suffixes)
    report = lint(Facts(one.model, against=other), XRF)
    assert (report.findings, report.skipped) == ((), ())


def test_permutation_in_message_is_correct(robot_of):
    """The list in the message reorders values from joint order to actuator order."""
    names = ["c", "a", "d", "b"]
    joints = "".join(
        f'<body name="{name}"><joint name="{name}" axis="0 0 1" range="-1 1"/><geom size="0.1"/>'
        "</body>"
        for name in "abcd"
    )
    motors = "".join(f'<motor name="{name}" joint="{name}"/>' for name in names)
    text = (
        f'<mujoco><worldbody><body name="base"><geom size="0.1"/>{joints}</body></worldbody>'
        f"<actuator>{motors}</actuator></mujoco>"
    )
    urdf = '<robot name="r"><link name="base"/>{}</robot>'.format(
        "".join(
            f'<link name="{name}"/><joint name="{name}" type="revolute"><parent link="base"/>'
            f'<child link="{name}"/><limit lower="-1" upper="1" effort="1" velocity="1"/></joint>'
            for name in "abcd"
        )
    )
    report = lint(Facts(robot_of(text).model, against=robot_of(urdf)), XRF)
    (finding,) = [each for each in report.findings if each.code == "XRF005"]
    order = re.search(r"ctrl = joints\[\[([\d, ]+)\]\]", finding.message)[1]
    assert ["abcd"[int(place)] for place in order.split(",")] == names


def test_robot_without_links_is_skipped(robot_of):
    empty = robot_of('<robot name="nothing"/>')
    report = lint(Facts(robot_of("quadruped.urdf").model, against=empty), XRF)
    assert report.findings == report.crashed == ()
    assert len(report.skipped) == len(XRF)
    assert "has no links" in report.skipped[0].reason


def test_no_comparison_does_not_import_yourdfpy(robot_of):
    file = robot_of("quadruped.urdf").model.file
    code = (
        "import sys; from pathlib import Path; from terrainkit_robots.lint import check, settings; "
        f"check.check_robot(Path({str(file)!r}), settings.Settings(simulate=False)); "
        "assert 'yourdfpy' not in sys.modules"
    )
    subprocess.run([sys.executable, "-c", code], check=True, env={"PYTHONPATH": ":".join(sys.path)})
