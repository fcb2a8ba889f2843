"""A summary of the onboarding of a robot: one line per step."""

import math
from collections.abc import Iterator, Sequence
from typing import TYPE_CHECKING

from terrainkit_robots.lint.report.summary import summarize_findings
from terrainkit_robots.onboarding.equivalence import NUM_POSES
from terrainkit_robots.simulation.assessment import assess
from terrainkit_robots.text import count, names

if TYPE_CHECKING:
    from terrainkit_robots.lint.rule import Finding
    from terrainkit_robots.onboarding.result import OnboardResult
    from terrainkit_robots.onboarding.robot_files import RobotFiles
    from terrainkit_robots.onboarding.verify import Verification
    from terrainkit_robots.simulation.standing import StandResult


def summarize(result: "OnboardResult") -> Iterator[tuple[str, str]]:
    """Yield a label and a sentence for each step."""
    yield "checked", summarize_findings([result.report])
    if result.fixed:
        codes = dict.fromkeys(finding.code for finding in result.fixed)
        yield "fixed", f"{count(len(result.fixed), 'finding')}: {names(codes)}"
        yield from _repairs(result.fixed)
    if result.robot is None or result.verification is None:
        return
    yield "wrote", _list_files(result.robot)
    yield "compared", _compare_files(result.verification)
    yield "standing", _standing_text(result.verification, result.robot)
    if result.verification.free_standing is not None:
        yield "free", _free_standing_text(result.verification.free_standing)
    if result.configs:
        yield "configs", names(file for files in result.configs.values() for file in files)
    for framework, reason in result.skipped_configs.items():
        yield "skipped", f"{framework}: {reason}"
    pictures = f"{count(len(result.images), 'picture')} in report.md"
    yield "pictures", pictures if result.images else f"none: {result.images_error}"
    if result.edits:
        yield (
            "backups",
            f"your edits are in {names(result.edits)}; use --spec to apply the values of a spec",
        )
    num_missing = len(_repairable(result.report.findings, "MSH"))
    if num_missing:
        missing = "mesh is" if num_missing == 1 else "meshes are"
        yield (
            "missing",
            f"{num_missing} {missing} missing; set the folder of a package with --package NAME=DIR",
        )
    if result.robot.changes:
        yield "notes", f"{count(len(result.robot.changes), 'change')} listed in report.md"


def _repairs(fixed: "Sequence[Finding]") -> Iterator[tuple[str, str]]:
    """Yield the repairs of inertias and of mesh paths, which may change the robot."""
    for noun, family in (("inertia", "INR"), ("path", "MSH")):
        subjects = _repairable(fixed, family)
        if subjects:
            plural = "s" if len(subjects) > 1 else ""
            yield "repaired", f"the {noun}{plural} of {names(subjects, max_count=3)}; see report.md"


def _repairable(findings: "Sequence[Finding]", family: str) -> list[str]:
    """Return the subjects of the findings that onboarding can repair."""
    return [f.subject for f in findings if f.onboarding == "repairs" and f.family == family]


def _list_files(robot: "RobotFiles") -> str:
    meshes = [data for name, data in robot.files.items() if "/" in name]
    texts = [name for name in robot.files if "/" not in name]
    size = sum(map(len, meshes)) / 1e6
    more = f", {count(len(meshes), 'mesh file')} ({size:.1f} MB)" if meshes else ""
    return f"{names(texts)}{more}"


def _compare_files(checks: "Verification") -> str:
    equivalences = checks.equivalences
    distance = max(equivalence.distance for equivalence in equivalences)
    mass = max(abs(equivalence.mass) for equivalence in equivalences)
    files = " and ".join(equivalence.file for equivalence in equivalences)
    return (
        f"{files} match the source: link positions within {1000 * distance:.2g} mm at {NUM_POSES} "
        f"poses, mass within {mass:.2g}"
    )


def _standing_text(checks: "Verification", robot: "RobotFiles") -> str:
    standing = checks.standing
    if checks.error or checks.skipped:
        return f"not simulated: {checks.error or checks.skipped}"
    if standing is None:
        return f"not simulated: the robot has {'a fixed base' if robot.facts.legs else 'no legs'}"
    locked = "with locked joints, since bipeds need a controller to balance"
    how = locked if checks.joints_locked else "with the gains of robot.toml"
    if checks.stand_gains:
        how = "with suggested gains, which hold the pose without a policy"
    if checks.failures:
        return f"NO: {standing.seconds:g} s {how}; {'; '.join(checks.failures)}"
    tilt = f"tilt {math.degrees(standing.tilt):.1f} degrees"
    return f"yes: {standing.seconds:g} s {how}, {tilt}, only the feet touch the ground"


def _free_standing_text(standing: "StandResult") -> str:
    failures = assess(standing).failures
    how = "with the gains of robot.toml and without a policy"
    if failures:
        return f"no, a policy has to balance it: {standing.seconds:g} s {how}; {failures[0]}"
    return f"yes: {standing.seconds:g} s {how}"
