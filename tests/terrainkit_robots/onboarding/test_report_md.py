import re
from dataclasses import replace
from pathlib import Path

import pytest

from terrainkit_robots.analysis.facts import Facts
from terrainkit_robots.description import bundled
from terrainkit_robots.description.fix import Fix
from terrainkit_robots.description.load import load_robot
from terrainkit_robots.description.model import Source
from terrainkit_robots.lint.rule import Finding
from terrainkit_robots.lint.runner import Report, Skipped
from terrainkit_robots.onboarding.derive_spec.derive import derive_spec
from terrainkit_robots.onboarding.equivalence import Equivalence
from terrainkit_robots.onboarding.report_md import report_markdown
from terrainkit_robots.onboarding.result import OnboardResult
from terrainkit_robots.onboarding.robot_files import RobotFiles
from terrainkit_robots.onboarding.verify import Verification
from terrainkit_robots.simulation.gain import Gain
from terrainkit_robots.simulation.standing import StandResult

NASTY = 'a|b`c*_<b>@me\x1b[31m\r\n# title\u202e\udc80"$'
"""A name with characters that could break a table or a terminal."""

STOOD = StandResult(
    tilt=0.01,
    max_tilt=0.02,
    height=0.3125,
    height_loss=0.004,
    drift=0.0012,
    leg_length=0.4,
    other_contacts=(),
    lifted_feet=(),
    saturation=0.413,
    saturated_joint="FL_calf_joint",
    joint_error=0.02,
    diverged=False,
    seconds=5.0,
)

ARM = """<robot name="arm"><link name="base"/><link name="tip"/>
<joint name="j" type="continuous"><parent link="base"/><child link="tip"/></joint></robot>"""


def equivalence(file, *, mass=0.0, distance=1e-6, link="FL_foot"):
    return Equivalence(
        file=file,
        mass=mass,
        inertia=2e-5,
        joint="FL_calf_joint",
        distance=distance,
        link=link,
        angle=1e-5,
        angle_link="RR_foot",
    )


def facts_of(text=None):
    path = bundled.urdf_path("quadruped")
    return Facts(load_robot(path, contents={} if text is None else {path: text.encode()}))


def make_result(facts, **changes):
    gains = {
        joint.name: Gain(stiffness=20.0, damping=0.5, armature=0.01, reason="so")
        for joint in facts.actuated
    }
    spec = derive_spec(facts, gains=gains, floating=bool(facts.legs))
    robot = RobotFiles(facts=facts, spec=spec, files={}, changes=())
    fields = {"report": Report(facts=facts, findings=()), "folder": Path("out"), "robot": robot}
    return OnboardResult(**fields | changes)


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
    return make_result(facts_of())


@pytest.fixture(scope="module")
def arm():
    return make_result(facts_of(ARM))


def with_changes(result, *changes):
    return replace(result, robot=replace(result.robot, changes=changes))


def headings(text):
    return re.findall(r"^#+ (.*)$", text, re.MULTILINE)


def section(text, title):
    return text.split(f"## {title}\n")[1].split("\n## ")[0]


def cells(row):
    return [cell.strip() for cell in re.split(r"(?<!\\)\|", row)[1:-1]]


def test_report_has_all_sections(quadruped):
    verification = Verification(
        equivalences=(equivalence("robot.urdf"),),
        standing=STOOD,
    )
    assert headings(report_markdown(replace(quadruped, verification=verification))) == [
        "quadruped",
        "Changes",
        "Standing test",
        "Comparison with the source",
        "Joints",
        "Joint order by simulator",
        "Findings",
        "Next steps",
    ]


def test_report_tables_have_rows_of_equal_length(quadruped):
    verification = Verification(equivalences=(), standing=STOOD)
    report = Report(facts=quadruped.robot.facts, findings=(finding(),))
    text = report_markdown(
        replace(quadruped, verification=verification, report=report, images=("report/a.png",))
    )
    tables = re.findall(r"(?:^\|.*\|\n)+", text, re.MULTILINE)
    assert len(tables) == 5
    for table in tables:
        rows = [cells(row) for row in table.splitlines()]
        assert len({len(row) for row in rows}) == 1
        assert set(rows[1]) == {"---"}


def test_report_overview(quadruped):
    text = report_markdown(quadruped)
    assert "quadruped weighs 15.02 kg and has 13 rigid bodies and 12 actuated joints. " in text
    assert "It stands on 4 legs, 0.448 m long: FL\\_foot, FR\\_foot, RL\\_foot, RR\\_foot." in text
    stance = quadruped.robot.facts.stance
    assert f"its base is {stance.height:.3f} m above the ground" in text


def test_report_shows_pictures_or_reason(quadruped):
    shots = ("report/front.png", "report/side.png")
    text = report_markdown(replace(quadruped, images=shots))
    assert (
        "| front | side |\n|---|---|\n| ![front](report/front.png) | ![side](report/side.png) |\n"
    ) in text
    without = report_markdown(replace(quadruped, images_error="MuJoCo cannot render here"))
    assert "\nNo pictures: MuJoCo cannot render here.\n" in without
    assert "![" not in without


def test_report_lists_changes(quadruped):
    fix = Fix(safety="safe", description="make it 1 kg", edits=())
    result = with_changes(replace(quadruped, fixed=(finding(fix=fix),)), "the wheel | was left out")
    text = section(report_markdown(result), "Changes")
    assert "- INR002: calf: make it 1 kg\n" in text
    assert "- the wheel \\| was left out\n" in text
    assert "Nothing was fixed" not in text
    assert "Nothing was fixed" in section(report_markdown(quadruped), "Changes")


def test_report_standing_test(quadruped):
    text = section(
        report_markdown(
            replace(quadruped, verification=Verification(equivalences=(), standing=STOOD))
        ),
        "Standing test",
    )
    assert "**It stands**, at its default pose" in text
    rows = dict(cells(row) for row in text.splitlines() if row.startswith("|"))
    assert rows["tilt"] == "0.57 deg at the end, 1.1 deg at most"
    assert rows["base height"] == "0.312 m at the end, 4.0 mm below the start"
    assert rows["drift"] == "1.2 mm"
    assert rows["ground contacts"] == "only the feet"
    assert rows["largest torque"] == "41% of the effort limit of FL\\_calf\\_joint"
    assert rows["largest joint position error"] == "0.02 rad"
    assert rows["duration"] == "5 s"


def test_report_failed_standing_test(quadruped):
    fell = replace(STOOD, tilt=1.5, other_contacts=("base", "FL_hip"), diverged=True, seconds=0.3)
    verification = Verification(equivalences=(), standing=fell, joints_locked=True)
    text = section(report_markdown(replace(quadruped, verification=verification)), "Standing test")
    assert "**It does not stand**, with locked joints" in text
    assert "| ground contacts | base, FL\\_hip |" in text
    assert "| duration | 0.3 s; then the simulation became unstable |" in text
    assert "largest torque" not in text


def test_report_without_standing_test(quadruped):
    assert "It was not simulated." in section(report_markdown(quadruped), "Standing test")


def test_report_comparison_with_source(quadruped):
    off = equivalence("robot.urdf", mass=-0.0004, distance=2.5e-5)
    text = report_markdown(replace(quadruped, verification=Verification(equivalences=(off,))))
    assert (
        "| robot.urdf | -0.040% | 0.002% at FL\\_calf\\_joint | 0.025 mm at FL\\_foot "
        "| 0.00057 deg at RR\\_foot |"
    ) in text


def test_report_permutations_are_valid_python(quadruped):
    text = section(report_markdown(quadruped), "Joint order by simulator")
    code = re.search(r"```python\n(.*?)```", text, re.DOTALL)[1]
    names: dict[str, list[int]] = {}
    exec(code, names)
    here = list(quadruped.robot.spec.joint_order)
    there = [here[i] for i in names["to_isaac_lab"]]
    assert there[:4] == ["FL_hip_joint", "FR_hip_joint", "RL_hip_joint", "RR_hip_joint"]
    assert [there[i] for i in names["from_isaac_lab"]] == here
    assert "to_mujoco" not in names


def test_report_same_joint_order(arm):
    assert "All simulators use the order of robot.toml." in report_markdown(arm)


def test_report_skips_permutations_of_unknown_joints(quadruped):
    robot = quadruped.robot
    spec = replace(robot.spec, joint_order=("other", *robot.spec.joint_order[1:]))
    text = report_markdown(replace(quadruped, robot=replace(robot, spec=spec)))
    assert "```python" not in text
    assert "| 0 | other |" in text


def test_report_without_legs(arm):
    text = report_markdown(arm)
    assert "No legs were found" in text
    assert "is fixed to the world" in text
    assert "Standing test" not in headings(text)
    assert "holding" not in text


def test_report_lists_unactuated_joints(quadruped):
    robot = quadruped.robot
    spec = replace(robot.spec, joint_order=robot.spec.joint_order[:-1])
    text = report_markdown(replace(quadruped, robot=replace(robot, spec=spec)))
    assert "Not actuated: RR\\_calf\\_joint." in text


def test_report_lists_findings_and_skipped_rules(quadruped):
    report = Report(
        facts=quadruped.robot.facts,
        findings=(finding(severity="warning"),),
        skipped=(
            Skipped(code="SYM001", kind="cannot-check", reason="no legs"),
            Skipped(code="SYM002", kind="cannot-check", reason="no legs"),
        ),
    )
    text = section(report_markdown(replace(quadruped, report=report)), "Findings")
    assert "**1 warning**" in text
    row = next(row for row in text.splitlines() if "INR002" in row)
    assert cells(row)[2:] == ["robot.urdf:12", "the mass is -1 kg", "Weigh it."]
    assert "- SYM001, SYM002: no legs\n" in text


def test_report_lists_configurations(quadruped):
    text = report_markdown(replace(quadruped, configs={"mjlab": ("mjlab_config.py",)}))
    assert "- mjlab\\_config.py" in section(text, "Next steps")


def test_report_escapes_names(quadruped):
    robot = quadruped.robot
    held = NASTY.replace("\udc80", "")  # which a spec refuses
    spec = replace(robot.spec, name=held, base=held, feet=(held,))
    report = Report(
        facts=robot.facts,
        findings=(finding(subject=NASTY, message=NASTY, hint=NASTY, file=Path(NASTY)),),
        skipped=(Skipped(code="SYM001", kind="cannot-check", reason=NASTY),),
    )
    verification = Verification(
        equivalences=(equivalence(NASTY, link=NASTY),),
        standing=replace(STOOD, other_contacts=(NASTY,), saturated_joint=NASTY),
    )
    result = replace(
        quadruped,
        robot=replace(robot, spec=spec, changes=(NASTY,)),
        report=report,
        verification=verification,
        fixed=(finding(subject=NASTY, message=NASTY),),
        configs={"isaaclab": (NASTY,)},
        images_error=NASTY,
    )
    text = report_markdown(result)
    for wrong in ("<b>", "@me", "\x1b", "\r", "\u202e", "\n# title"):
        assert wrong not in text
    without_ours = re.sub(
        r"```.*?```|\*\*[^*]+\*\*|`simulator_values = [^`]*`", "", text, flags=re.DOTALL
    )
    assert re.search(r"(?<!\\)[`*]", without_ours) is None
    text.encode()


def test_report_quotes_file_names(quadruped):
    robot = quadruped.robot
    spec = replace(robot.spec, urdf="a b;c.urdf")
    text = report_markdown(replace(quadruped, robot=replace(robot, spec=spec)))
    assert "terrainkit check-robot 'a b;c.urdf' --spec robot.toml" in text
