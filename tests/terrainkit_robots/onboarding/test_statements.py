"""Tests of report.md. The whole report on a quadruped is in quadruped_report.txt."""

import re
from dataclasses import replace
from pathlib import Path

import pytest

from terrainkit_robots.analysis.facts import Facts
from terrainkit_robots.description.fix import Fix
from terrainkit_robots.description.load import load_robot
from terrainkit_robots.description.model import Source
from terrainkit_robots.lint.rule import Finding
from terrainkit_robots.lint.runner import Report, Skipped
from terrainkit_robots.onboarding.comparison import Comparison
from terrainkit_robots.onboarding.convert import RobotFiles
from terrainkit_robots.onboarding.derive_spec.derive import derive_spec
from terrainkit_robots.onboarding.result import OnboardResult
from terrainkit_robots.onboarding.statements import report_markdown
from terrainkit_robots.onboarding.verify import Verification
from terrainkit_robots.simulation.gain import Gain
from tests.robots import QUADRUPED

NASTY = 'a|b`c*_<b>@me\x1b[31m\r\n# title\u202e\udc80"$'
"""A name with characters that could break a table or a terminal."""

ARM = """<robot name="arm"><link name="base"/><link name="tip"/>
<joint name="j" type="continuous"><parent link="base"/><child link="tip"/></joint></robot>"""


def comparison(file="robot.urdf", link="FL_foot"):
    errors = {"mass": (0.0004, ""), "link position": (2.5e-5, link), "link rotation": (0.0, link)}
    return Comparison(file=file, errors=errors, changes=(f"limits of {link}",))


def make_result(text=None):
    contents = {} if text is None else {QUADRUPED: text.encode()}
    facts = Facts(load_robot(QUADRUPED, contents=contents))
    gain = Gain(stiffness=20.0, damping=0.5, armature=0.01, reason="so")
    gains = {joint.name: gain for joint in facts.actuated}
    spec = derive_spec(facts, gains=gains, floating=bool(facts.legs))
    robot = RobotFiles(facts=facts, spec=spec, files={}, changes=())
    report = Report(facts=facts, findings=())
    verification = Verification()
    return OnboardResult(report=report, folder=Path("out"), robot=robot, verification=verification)


def finding(file="robot.urdf", **changes):
    fields = {
        "code": "INR002",
        "name": "negative-mass",
        "severity": "error",
        "certainty": "proven",
        "subject": "calf",
        "message": "the mass is -1 kg",
        "hint": "Weigh it.",
        "source": Source(file=Path(file), line=12),
    }
    return Finding(**fields | changes)


@pytest.fixture(scope="module")
def quadruped():
    return make_result()


def with_spec(result, **changes):
    robot = result.robot
    return replace(result, robot=replace(robot, spec=replace(robot.spec, **changes)))


def section(text, title):
    return text.split(f"## {title}\n")[1].split("\n## ")[0]


def test_report_of_a_quadruped(quadruped, stood, monkeypatch):
    """Every section has content: pictures, changes, a standing test and findings."""
    monkeypatch.chdir(QUADRUPED.parent)
    fix = Fix(safety="safe", description="make it 1 kg", edits=())
    skipped = tuple(
        Skipped(code=code, kind="cannot-check", reason="no legs") for code in ("SYM001", "SYM002")
    )
    facts = quadruped.robot.facts
    result = replace(
        quadruped,
        images=("report/front.png", "report/side.png"),
        fixed=(finding(fix=fix), finding(subject="")),
        robot=replace(quadruped.robot, changes=("the wheel | was left out",)),
        verification=Verification(comparisons=(comparison(),), standing=stood),
        report=Report(facts=facts, findings=(finding(severity="warning"),), skipped=skipped),
        configs={"mjlab": ("mjlab_config.py",), "isaaclab": ("isaaclab_config.py",)},
    )
    assert report_markdown(result) == Path(__file__).with_name("quadruped_report.txt").read_text()


def test_report_permutations_are_valid_python(quadruped):
    text = section(report_markdown(quadruped), "Joint order by simulator")
    names: dict[str, list[int]] = {}
    exec(re.search(r"```python\n(.*?)```", text, re.DOTALL)[1], names)
    here = list(quadruped.robot.spec.joint_order)
    there = [here[i] for i in names["to_isaac_lab"]]
    assert there[:4] == ["FL_hip_joint", "FR_hip_joint", "RL_hip_joint", "RR_hip_joint"]
    assert [there[i] for i in names["from_isaac_lab"]] == here
    assert "to_mujoco" not in names


def test_report_without_results(quadruped):
    text = report_markdown(replace(quadruped, images_error="MuJoCo cannot render here"))
    assert "\nNo pictures: MuJoCo cannot render here.\n" in text
    assert "![" not in text
    assert "Nothing was fixed, omitted or changed." in section(text, "Changes")
    assert section(text, "Standing test").strip() == "Not simulated: the robot has a fixed base."
    assert "## Comparison with the source" not in text


def test_report_failed_standing_test(quadruped, stood):
    fell = replace(stood, tilt=1.5, other_contacts=("base", "FL_hip"), diverged=True, seconds=0.3)
    verification = Verification(standing=fell, joints_locked=True)
    text = section(report_markdown(replace(quadruped, verification=verification)), "Standing test")
    assert text.strip().startswith("NO: 0.3 s with locked joints, since bipeds")
    assert "| ground contacts | base, FL\\_hip |" in text
    assert "| duration | 0.3 s; then the simulation became unstable |" in text
    assert "largest torque" not in text


def test_report_without_legs():
    text = report_markdown(make_result(ARM))
    assert "No legs were found" in text
    assert "is fixed to the world" in text
    assert "All simulators use the order of robot.toml." in text
    assert "## Standing test" not in text
    assert "holding" not in text


def test_report_of_other_joints_and_files(quadruped):
    joints = quadruped.robot.spec.joint_order
    text = report_markdown(with_spec(quadruped, joint_order=("other", *joints[1:-1])))
    assert "```python" not in text
    assert "| 0 | other |" in text
    assert "Not actuated: FL\\_hip\\_joint, RR\\_calf\\_joint." in text
    text = report_markdown(with_spec(quadruped, urdf="a b;c.urdf"))
    assert "terrainkit check-robot 'a b;c.urdf' --spec robot.toml" in text


def test_report_escapes_names(quadruped, stood):
    held = NASTY.replace("\udc80", "")  # which a spec refuses
    named = with_spec(quadruped, name=held, base=held, feet=(held,))
    standing = replace(stood, other_contacts=(NASTY,), saturated_joint=NASTY)
    compared = comparison(NASTY, link=NASTY)
    text = report_markdown(
        replace(
            named,
            robot=replace(named.robot, changes=(NASTY,)),
            report=Report(
                facts=named.robot.facts,
                findings=(finding(NASTY, subject=NASTY, message=NASTY, hint=NASTY),),
                skipped=(Skipped(code="SYM001", kind="cannot-check", reason=NASTY),),
            ),
            verification=Verification(comparisons=(compared,), standing=standing),
            fixed=(finding(subject=NASTY, message=NASTY),),
            configs={"isaaclab": (NASTY,)},
            images_error=NASTY,
        )
    )
    wrong = ("<b>", "@me", "\x1b", "\r", "\u202e", "\n# title")
    assert not [each for each in wrong if each in text]
    ours = r"```.*?```|\*\*[^*]+\*\*|`simulator_values = [^`]*`"
    assert re.search(r"(?<!\\)[`*]", re.sub(ours, "", text, flags=re.DOTALL)) is None
    text.encode()
