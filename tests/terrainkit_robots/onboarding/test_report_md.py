import re
from dataclasses import replace
from pathlib import Path

import pytest

from terrainkit_robots.analysis.facts import Facts
from terrainkit_robots.description import bundled
from terrainkit_robots.description.fix import Fix
from terrainkit_robots.description.load import load_robot
from terrainkit_robots.lint.runner import Finding, Report, Skipped
from terrainkit_robots.onboarding.derive_spec.derive import derive_spec
from terrainkit_robots.onboarding.equivalence import Agreement
from terrainkit_robots.onboarding.pipeline import BroughtIn
from terrainkit_robots.onboarding.report_md import report_page
from terrainkit_robots.onboarding.robot_files import Onboarded
from terrainkit_robots.onboarding.verify import Proof
from terrainkit_robots.simulation.pd_gains import Gain
from terrainkit_robots.simulation.standing import Standing

NASTY = 'a|b`c*_<b>@me\x1b[31m\r\n# title\u202e\udc80"$'
"""A name with something in it for a table to trip over."""

STOOD = Standing(
    tilt=0.01,
    largest_tilt=0.02,
    height=0.3125,
    sink=0.004,
    drift=0.0012,
    leg_length=0.4,
    touching=(),
    lifted=(),
    saturation=0.413,
    saturated="FL_calf_joint",
    joint_error=0.02,
    blew_up=False,
    seconds=5.0,
)

ARM = """<robot name="arm"><link name="base"/><link name="tip"/>
<joint name="j" type="continuous"><parent link="base"/><child link="tip"/></joint></robot>"""


def agreement(file, *, mass=0.0, distance=1e-6, link="FL_foot"):
    return Agreement(
        file=file,
        mass=mass,
        inertia=2e-5,
        joint="FL_calf_joint",
        distance=distance,
        link=link,
        angle=1e-5,
        turned="RR_foot",
    )


def facts_of(text=None):
    path = bundled.find("quadruped")
    return Facts(load_robot(path, contents={} if text is None else {path: text.encode()}))


def brought(facts, **changes):
    gains = {
        joint.name: Gain(stiffness=20.0, damping=0.5, armature=0.01, reason="so")
        for joint in facts.actuated
    }
    spec = derive_spec(facts, gains=gains, floating=bool(facts.legs))
    made = Onboarded(facts=facts, spec=spec, files={}, notes=())
    fields = {"report": Report(facts=facts, findings=()), "folder": Path("out"), "made": made}
    return BroughtIn(**fields | changes)


def finding(**changes):
    fields = {
        "code": "INR002",
        "name": "negative-mass",
        "severity": "error",
        "certainty": "proven",
        "subject": "calf",
        "message": "the mass is -1 kg",
        "hint": "Weigh it.",
        "file": Path("robot.urdf"),
        "line": 12,
    }
    return Finding(**fields | changes)


@pytest.fixture(scope="module")
def quadruped():
    return brought(facts_of())


@pytest.fixture(scope="module")
def arm():
    return brought(facts_of(ARM))


def noted(done, *notes):
    return replace(done, made=replace(done.made, notes=notes))


def headings(text):
    return re.findall(r"^#+ (.*)$", text, re.MULTILINE)


def section(text, title):
    return text.split(f"## {title}\n")[1].split("\n## ")[0]


def cells(row):
    return [cell.strip() for cell in re.split(r"(?<!\\)\|", row)[1:-1]]


def test_each_section_is_there_once_in_order(quadruped):
    proof = Proof(
        agreements=(agreement("robot.urdf"),),
        standing=STOOD,
    )
    assert headings(report_page(replace(quadruped, proof=proof))) == [
        "quadruped",
        "What was done",
        "Standing",
        "The files against their source",
        "Joints",
        "Joint order by simulator",
        "Findings",
        "Next steps",
    ]


def test_every_table_has_rows_of_one_width(quadruped):
    proof = Proof(agreements=(), standing=STOOD)
    report = Report(facts=quadruped.made.facts, findings=(finding(),))
    text = report_page(replace(quadruped, proof=proof, report=report, pictures=("report/a.png",)))
    tables = re.findall(r"(?:^\|.*\|\n)+", text, re.MULTILINE)
    assert len(tables) == 5
    for table in tables:
        rows = [cells(row) for row in table.splitlines()]
        assert len({len(row) for row in rows}) == 1
        assert set(rows[1]) == {"---"}


def test_the_summary_says_what_it_is_and_how_it_stands(quadruped):
    text = report_page(quadruped)
    assert "quadruped weighs 15.02 kg and has 13 rigid bodies and 12 actuated joints. " in text
    assert "It stands on 4 legs, 0.448 m long: FL\\_foot, FR\\_foot, RL\\_foot, RR\\_foot." in text
    stance = quadruped.made.facts.stance
    assert f"its base is {stance.height:.3f} m above the ground" in text


def test_pictures_or_why_there_are_none(quadruped):
    shots = ("report/front.png", "report/side.png")
    text = report_page(replace(quadruped, pictures=shots))
    assert (
        "| front | side |\n|---|---|\n| ![front](report/front.png) | ![side](report/side.png) |\n"
    ) in text
    without = report_page(replace(quadruped, no_pictures="MuJoCo cannot draw here"))
    assert "\nNo pictures: MuJoCo cannot draw here.\n" in without
    assert "![" not in without


def test_what_was_repaired_and_what_was_left_out(quadruped):
    fix = Fix(safety="safe", description="make it 1 kg", edits=())
    done = noted(replace(quadruped, repaired=(finding(fix=fix),)), "the wheel | was left out")
    text = section(report_page(done), "What was done")
    assert "- INR002: calf: make it 1 kg\n" in text
    assert "- the wheel \\| was left out\n" in text
    assert "Nothing had to be" not in text
    assert "Nothing had to be" in section(report_page(quadruped), "What was done")


def test_how_it_stood(quadruped):
    text = section(
        report_page(replace(quadruped, proof=Proof(agreements=(), standing=STOOD))), "Standing"
    )
    assert "**It stands**, at its default pose" in text
    rows = dict(cells(row) for row in text.splitlines() if row.startswith("|"))
    assert rows["tilt"] == "0.57 deg at the end, 1.1 deg at most"
    assert rows["height of the base"] == "0.312 m at the end, 4.0 mm below the start"
    assert rows["drift"] == "1.2 mm"
    assert rows["touched the ground"] == "only the feet"
    assert rows["largest torque"] == "41% of the effort of FL\\_calf\\_joint"
    assert rows["farthest joint from its target"] == "0.02 rad"
    assert rows["simulated"] == "5 s"


def test_that_it_fell(quadruped):
    fell = replace(STOOD, tilt=1.5, touching=("base", "FL_hip"), blew_up=True, seconds=0.3)
    proof = Proof(agreements=(), standing=fell, locked=True)
    text = section(report_page(replace(quadruped, proof=proof)), "Standing")
    assert "**It does not stand**, with its joints locked" in text
    assert "| touched the ground | base, FL\\_hip |" in text
    assert "| simulated | 0.3 s; then its numbers blew up |" in text
    assert "largest torque" not in text


def test_that_it_was_not_simulated(quadruped):
    assert "It was not simulated." in section(report_page(quadruped), "Standing")


def test_how_far_the_files_are_from_their_source(quadruped):
    off = agreement("robot.urdf", mass=-0.0004, distance=2.5e-5)
    text = report_page(replace(quadruped, proof=Proof(agreements=(off,))))
    assert (
        "| robot.urdf | -0.040% | 0.002% at FL\\_calf\\_joint | 0.025 mm at FL\\_foot "
        "| 0.00057 deg at RR\\_foot |"
    ) in text


def test_permutations_are_python_that_is_ready_to_be_pasted(quadruped):
    text = section(report_page(quadruped), "Joint order by simulator")
    code = re.search(r"```python\n(.*?)```", text, re.DOTALL)[1]
    names: dict[str, list[int]] = {}
    exec(code, names)
    here = list(quadruped.made.spec.joint_order)
    there = [here[i] for i in names["to_isaac_lab"]]
    assert there[:4] == ["FL_hip_joint", "FR_hip_joint", "RL_hip_joint", "RR_hip_joint"]
    assert [there[i] for i in names["from_isaac_lab"]] == here
    assert "to_mujoco" not in names


def test_one_order_for_all_is_said(arm):
    assert "All of them have the actuated joints in the order of robot.toml." in report_page(arm)


def test_a_spec_with_joints_of_its_own_costs_only_the_permutations(quadruped):
    made = quadruped.made
    spec = replace(made.spec, joint_order=("other", *made.spec.joint_order[1:]))
    text = report_page(replace(quadruped, made=replace(made, spec=spec)))
    assert "```python" not in text
    assert "| 0 | other |" in text


def test_a_robot_without_legs_has_no_leg_parts(arm):
    text = report_page(arm)
    assert "No legs were found" in text
    assert "is fixed to the world" in text
    assert "Standing" not in headings(text)
    assert "holds" not in text


def test_joints_without_a_motor_are_told(quadruped):
    made = quadruped.made
    spec = replace(made.spec, joint_order=made.spec.joint_order[:-1])
    text = report_page(replace(quadruped, made=replace(made, spec=spec)))
    assert "Not driven by a motor: RR\\_calf\\_joint." in text


def test_findings_and_what_was_not_asked(quadruped):
    report = Report(
        facts=quadruped.made.facts,
        findings=(finding(severity="warning"),),
        skipped=(
            Skipped(code="SYM001", reason="no legs"),
            Skipped(code="SYM002", reason="no legs"),
        ),
    )
    text = section(report_page(replace(quadruped, report=report)), "Findings")
    assert "**1 warning**" in text
    row = next(row for row in text.splitlines() if "INR002" in row)
    assert cells(row)[2:] == ["robot.urdf:12", "the mass is -1 kg", "Weigh it."]
    assert "- SYM001, SYM002: no legs\n" in text


def test_configurations_are_listed(quadruped):
    text = report_page(replace(quadruped, configs=("mjlab_config.py",)))
    assert "- mjlab\\_config.py" in section(text, "Next steps")


def test_no_name_breaks_a_row_or_becomes_markup(quadruped):
    made = quadruped.made
    held = NASTY.replace("\udc80", "")  # which a spec refuses
    spec = replace(made.spec, name=held, base=held, feet=(held,))
    report = Report(
        facts=made.facts,
        findings=(finding(subject=NASTY, message=NASTY, hint=NASTY, file=Path(NASTY)),),
        skipped=(Skipped(code="SYM001", reason=NASTY),),
    )
    proof = Proof(
        agreements=(agreement(NASTY, link=NASTY),),
        standing=replace(STOOD, touching=(NASTY,), saturated=NASTY),
    )
    done = replace(
        quadruped,
        made=replace(made, spec=spec, notes=(NASTY,)),
        report=report,
        proof=proof,
        repaired=(finding(subject=NASTY, message=NASTY),),
        configs=(NASTY,),
        no_pictures=NASTY,
    )
    text = report_page(done)
    for wrong in ("<b>", "@me", "\x1b", "\r", "\u202e", "\n# title"):
        assert wrong not in text
    without_ours = re.sub(r"```.*?```|\*\*[^*]+\*\*|`there = [^`]*`", "", text, flags=re.DOTALL)
    assert re.search(r"(?<!\\)[`*]", without_ours) is None
    text.encode()


def test_a_name_of_a_file_is_one_word_of_a_command(quadruped):
    made = quadruped.made
    spec = replace(made.spec, urdf="a b;c.urdf")
    text = report_page(replace(quadruped, made=replace(made, spec=spec)))
    assert "terrainkit check-robot 'a b;c.urdf' --spec robot.toml" in text
