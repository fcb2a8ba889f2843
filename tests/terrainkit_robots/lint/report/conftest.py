"""Reports with everything that a format has to handle."""

from pathlib import Path

import pytest

from terrainkit_robots.analysis.facts import Facts
from terrainkit_robots.description.fix import Fix
from terrainkit_robots.description.model import RobotModel, Source
from terrainkit_robots.lint.check import Suppressed
from terrainkit_robots.lint.rule import Finding
from terrainkit_robots.lint.runner import Report, Skipped
from terrainkit_robots.lint.suppressions import read_comments

NASTY = 'a,b:c%d|e{0}<b>@me`*_\x1b[31m\r\n::error::x\u202e\udc80"'
"""A name with characters that each format has to escape."""


@pytest.fixture
def model():
    def make(name="r", file="robot.urdf"):
        path = Path(file)
        return RobotModel(name=name, kind="urdf", file=path, source=Source(file=path, line=1))

    return make


@pytest.fixture
def finding():
    def make(
        code="INR002", name="negative-mass", severity="error", file="robot.urdf", line=12, **changes
    ):
        fields = {
            "certainty": "proven",
            "subject": "calf",
            "message": "the mass is -1 kg; expected > 0",
            "hint": "Weigh it.",
            "source": Source(file=Path(file), line=line),
            "measured": {"mass": -1.0},
        }
        return Finding(code=code, name=name, severity=severity, **fields | changes)

    return make


@pytest.fixture
def report(model, finding):
    """Return a report with all severities, a suppressed finding and skipped rules."""
    fix = Fix(safety="safe", description="change the limit", edits=())
    quiet = finding(line=30, subject="hatch")
    (comment,) = read_comments(
        Path("robot.urdf"), b"<robot><!-- terrainkit: ignore INR002 so --></robot>"
    )
    return Report(
        facts=Facts(model()),
        findings=(
            finding(),
            finding("JNT007", "degrees", "warning", line=40, certainty="likely", fix=fix),
            finding("JNT007", "degrees", "warning", line=0, subject=""),
            finding("LEG004", "legs", "note", line=1, measured={"legs": 4}),
        ),
        skipped=(
            Skipped(code="SYM001", kind="no-legs", reason="no legs detected"),
            Skipped(code="SYM002", kind="no-legs", reason="no legs detected"),
            Suppressed(
                code="INR002",
                kind="suppressed",
                reason="suppressed: so",
                comment=comment,
                finding=quiet,
            ),
            Skipped(code="INR999", kind="unused", reason="comment at robot.urdf:3: unknown rule"),
        ),
    )


@pytest.fixture
def nasty(model, finding):
    """Return a report with special characters and infinite numbers."""
    path = Path(f"dir with space/{NASTY.replace(chr(0), '')}.urdf")
    bad = finding(
        subject=NASTY,
        message=f"{NASTY} is wrong",
        hint=NASTY,
        file=path,
        measured={NASTY: float("nan"), "large": float("inf"), "text": NASTY},
    )
    return Report(
        facts=Facts(model(NASTY, str(path))),
        findings=(bad,),
        skipped=(Skipped(code="SYM001", kind="cannot-check", reason=NASTY),),
    )


@pytest.fixture
def fixed_report(model, finding):
    """Return a report with a fixed and an unfixed finding."""
    fix = Fix(safety="safe", description="name it", edits=())
    done = finding("XML003", "unnamed-robot", "warning", fix=fix)
    left = finding("JNT009", "unit-axis", "warning", fix=fix)
    return Report(
        facts=Facts(model()), findings=(left,), fixed=(done,), unfixed=((left, "no space"),)
    )
