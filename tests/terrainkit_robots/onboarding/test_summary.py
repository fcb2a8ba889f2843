from dataclasses import replace
from types import SimpleNamespace

import pytest

from terrainkit_robots.onboarding import statements
from terrainkit_robots.onboarding.comparison import Comparison
from terrainkit_robots.onboarding.statements import summarize
from terrainkit_robots.onboarding.verify import Verification


def finding(code, subject, onboarding="repairs"):
    fix = SimpleNamespace(description=f"Replace {subject}.")
    return SimpleNamespace(
        code=code, family=code[:3], subject=subject, onboarding=onboarding, fix=fix, message=""
    )


@pytest.fixture
def lines(monkeypatch, stood):
    """Return a function that summarizes a robot that stood; keywords replace results."""
    monkeypatch.setattr(statements, "summarize_findings", lambda _: "2 findings")
    comparisons = (
        Comparison(file="robot.urdf", errors={"link position": (2e-6, "foot")}),
        Comparison(file="robot.xml", errors={"link position": (1e-6, "foot")}),
    )

    def run(standing=stood, files=(), legs=(1,), changes=(), missing=0, verified=None, **given):
        checks = Verification(comparisons=comparisons, standing=standing, **(verified or {}))
        findings = [finding("MSH001", "")] * missing + [finding("MSH002", "", "converts")]
        result = {
            "report": SimpleNamespace(findings=findings),
            "fixed": (),
            "robot": SimpleNamespace(
                files=dict(files),
                facts=SimpleNamespace(legs=legs, loops=(), joints=()),
                changes=changes,
            ),
            "verification": checks,
            "configs": {},
            "skipped_configs": {},
            "images": (),
            "images_error": "no display",
            "edits": (),
            "unjudged": "",
        }
        return dict(summarize(SimpleNamespace(**result | given)))

    return run


def test_summary_of_a_plain_robot(lines):
    files = {"robot.urdf": b"", "meshes/a.stl": b"x" * 1_000_000, "meshes/b.stl": b"x" * 500_000}
    assert lines(files=files) == {
        "checked": "2 findings",
        "wrote": "robot.urdf, 2 mesh files (1.5 MB)",
        "compared": "robot.urdf and robot.xml match the source at 30 states, link position within "
        "0.002 mm, mass matrix within 0",
        "standing": "yes: 5 s with the gains of robot.toml, tilt 0.6 degrees, only the feet touch "
        "the ground",
        "pictures": "none: no display",
    }


def test_summary_without_files_ends_after_the_fixes(lines):
    fixed = [finding("INR003", name) for name in "abcd"]
    assert lines(robot=None, fixed=fixed) == {
        "checked": "2 findings",
        "fixed": "4 findings: INR003",
        "repaired": "Replace a; Replace b; Replace c; 1 more; see report.md",
    }
    found = lines(robot=None, fixed=[finding("MSH004", "a.stl", "converts")])
    assert found["repaired"] == "Replace a.stl; see report.md"


def test_summary_lists_what_else_happened(lines):
    found = lines(
        configs={"mjlab": ("a.py", "b.py"), "isaaclab": ("c.py",)},
        skipped_configs={"legged_gym": "it has no legs"},
        images=("a.png",),
        images_error="",
        edits=("robot.toml.bak",),
        changes=("renamed it",),
        missing=1,
    )
    expected = {
        "configs": "a.py, b.py, c.py",
        "skipped": "legged_gym: it has no legs",
        "pictures": "1 picture in report.md",
        "notes": "1 change listed in report.md",
    }
    assert {name: found[name] for name in expected} == expected
    assert found["backups"].startswith("your edits are in robot.toml.bak; use --spec")
    assert found["missing"].startswith("1 mesh is missing; ")
    assert lines(missing=2)["missing"].startswith("2 meshes are missing; ")


@pytest.mark.parametrize(
    ("options", "text"),
    [
        ({"standing": None}, "not simulated: the robot has a fixed base"),
        ({"standing": None, "legs": ()}, "not simulated: the robot has no legs"),
        ({"verified": {"error": "too many contacts"}}, "not simulated: too many contacts"),
        (
            {"verified": {"joints_locked": True}},
            "yes: 5 s with locked joints, since bipeds need a controller to balance, tilt",
        ),
        ({"verified": {"stand_gains": True}}, "yes: 5 s with suggested gains, which"),
        ({"unjudged": "not judged: errors remain"}, "not judged: errors remain"),
    ],
)
def test_summary_says_how_the_robot_stood(lines, options, text):
    assert lines(**options)["standing"].startswith(text)


def test_summary_says_why_the_robot_fell(lines, stood):
    fallen = replace(stood, tilt=1.0)
    assert lines(standing=fallen)["standing"].startswith("NO: 5 s with the gains of robot.toml; ")
    free = lines(verified={"free_standing": fallen})["free"]
    assert free.startswith("no, a policy has to balance it: 5 s with the gains of robot.toml")
    free = lines(verified={"free_standing": stood})["free"]
    assert free == "yes: 5 s with the gains of robot.toml and without a policy"
