"""Write report.md: what was changed, how the robot stands, and what remains to be fixed."""

import math
import shlex
from collections.abc import Iterator, Sequence
from pathlib import PurePath
from typing import TYPE_CHECKING

from terrainkit_robots.analysis.bodies.joint_order import permutation
from terrainkit_robots.analysis.simulator_conventions.order_table import order_table
from terrainkit_robots.lint.report.escape import escape_control, escape_surrogates
from terrainkit_robots.lint.report.grouping import group_findings
from terrainkit_robots.lint.report.markdown import cell, findings_table, titled_list
from terrainkit_robots.lint.report.summary import group_skipped, summarize_findings
from terrainkit_robots.lint.rule import SEVERITIES
from terrainkit_robots.onboarding.frameworks.mjlab import train_arguments
from terrainkit_robots.onboarding.joint_table import format_number, joint_table
from terrainkit_robots.simulation.assessment import assess
from terrainkit_robots.text import count, display_path

if TYPE_CHECKING:
    from terrainkit_robots.lint.rule import Finding
    from terrainkit_robots.onboarding.result import OnboardResult
    from terrainkit_robots.onboarding.robot_files import RobotFiles
    from terrainkit_robots.onboarding.verify import Verification
    from terrainkit_robots.simulation.standing import StandResult


def report_markdown(result: "OnboardResult") -> str:
    """Return the text of report.md for a robot that was written."""
    assert result.robot is not None
    robot, checks = result.robot, result.verification
    sections = (
        _overview(result, robot),
        _changes(result, robot),
        _standing(checks, robot),
        _comparison(checks),
        _joints(robot),
        _simulators(robot),
        _findings(result),
        _next_steps(result, robot),
    )
    return escape_surrogates("\n".join(line for section in sections for line in section))


def _table(rows: Sequence[Sequence[str]]) -> Iterator[str]:
    """Yield the lines of a table; the first row is its header."""
    for index, row in enumerate(rows):
        yield f"| {' | '.join(map(cell, row))} |"
        if index == 0:
            yield "|---" * len(row) + "|"
    yield ""


def _overview(result: "OnboardResult", robot: "RobotFiles") -> Iterator[str]:
    yield f"# {cell(robot.spec.name)}\n"
    if result.images:
        titles = [PurePath(name).stem for name in result.images]
        yield f"| {' | '.join(map(cell, titles))} |"
        yield "|---" * len(titles) + "|"
        images = [f"![{cell(t)}]({n})" for t, n in zip(titles, result.images, strict=True)]
        yield f"| {' | '.join(images)} |\n"
    elif result.images_error:
        yield f"No pictures: {cell(result.images_error)}.\n"
    yield " ".join(_properties(robot)) + "\n"


def _properties(robot: "RobotFiles") -> Iterator[str]:
    """Yield sentences on the size, the base and the legs of a robot."""
    facts, spec = robot.facts, robot.spec
    joints = count(len(spec.joint_order), "actuated joint")
    num_bodies = sum(not body.virtual for body in facts.bodies)
    bodies = f"{num_bodies:,} rigid {'body' if num_bodies == 1 else 'bodies'}"
    mass = (
        f"weighs {format_number(facts.total_mass, 4)} kg and "
        if _is_finite(facts.total_mass)
        else ""
    )
    yield f"{cell(spec.name)} {mass}has {bodies} and {joints}."
    base = "floating" if spec.floating else "fixed to the world"
    yield f"Its base, {cell(spec.base)}, is {base}."
    if not facts.legs:
        yield (
            "No legs were found, so there are no feet, no standing pose and no spawn height, and "
            "the rules for legs were skipped."
        )
        return
    feet = ", ".join(map(cell, spec.feet))
    length = f", {format_number(spec.leg_length)} m long" if _is_finite(spec.leg_length) else ""
    yield f"It stands on {count(len(facts.legs), 'leg')}{length}: {feet}."
    height = facts.stance.height if facts.stance is not None else None
    measures = (
        ("its base is {} m above the ground", height),
        ("its spawn height is {} m", spec.spawn_height),
        ("its feet are {} m apart", spec.stance_width),
    )
    known = [text.format(format_number(value)) for text, value in measures if _is_finite(value)]
    if known:
        yield f"At the default pose, {', '.join(known)}."


def _is_finite(value: float | None) -> bool:
    return value is not None and math.isfinite(value)


def _changes(result: "OnboardResult", robot: "RobotFiles") -> Iterator[str]:
    yield "## Changes\n"
    file = cell(display_path(result.report.facts.model.file))
    yield f"The source is {file}; it was not changed.\n"
    yield from titled_list("Fixed in the written files", [_fix(f) for f in result.fixed])
    if robot.changes:
        yield "Omitted, changed or added:\n"
        yield from (f"- {cell(change)}" for change in robot.changes)
        yield ""
    if not (result.fixed or robot.changes):
        yield "Nothing was fixed, omitted or changed.\n"


def _fix(finding: "Finding") -> tuple[str, str]:
    text = finding.message if finding.fix is None else finding.fix.description
    return finding.code, f"{finding.subject}: {text}" if finding.subject else text


def _standing(checks: "Verification | None", robot: "RobotFiles") -> Iterator[str]:
    if not robot.facts.legs:
        return
    yield "## Standing test\n"
    if checks is None or checks.standing is None:
        reason = "" if checks is None else cell(checks.error or checks.skipped)
        yield f"It was not simulated{reason and f': {reason}'}.\n"
        return
    locked = checks.joints_locked
    how = "with locked joints" if locked else "at its default pose, with the gains below"
    if checks.stand_gains:
        how = "at its default pose, with suggested gains"
    outcome = "It stands" if checks.is_stable else "It does not stand"
    yield f"**{outcome}**, {how}, in MuJoCo:\n"
    has_slides = any(joint.kind == "prismatic" for joint in robot.facts.joints)
    unit = "rad or m" if has_slides else "rad"
    rows = _standing_rows(checks.standing, unit, locked=locked)
    yield from _table([("quantity", "value"), *rows])
    if checks.free_standing is not None:
        failures = assess(checks.free_standing).failures
        outcome = f"it does not stand: {'; '.join(failures)}" if failures else "it stands as well"
        yield f"With the gains below and without a policy, {cell(outcome)}.\n"


def _standing_rows(
    standing: "StandResult", unit: str, *, locked: bool
) -> Iterator[tuple[str, str]]:
    unstable = "; then the simulation became unstable" if standing.diverged else ""
    yield "duration", f"{format_number(standing.seconds)} s{unstable}"
    tilts = [format_number(math.degrees(t), 2) for t in (standing.tilt, standing.max_tilt)]
    yield "tilt", "{} deg at the end, {} deg at most".format(*tilts)
    sink = f"{1000 * standing.height_loss:.1f} mm below the start"
    yield "base height", f"{format_number(standing.height)} m at the end, {sink}"
    yield "drift", f"{1000 * standing.drift:.1f} mm"
    yield "ground contacts", ", ".join(standing.other_contacts) or "only the feet"
    if locked:
        return
    if standing.saturated_joint:
        effort = f"{standing.saturation:.0%} of the effort limit of {standing.saturated_joint}"
        yield "largest torque", effort
    yield "largest joint position error", f"{format_number(standing.joint_error, 2)} {unit}"


def _comparison(checks: "Verification | None") -> Iterator[str]:
    if checks is None or not checks.equivalences:
        return
    yield "## Comparison with the source\n"
    rows = [
        (
            equivalence.file,
            f"{round(equivalence.mass, 5) + 0.0:+.3%}",
            f"{equivalence.inertia:.3%} at {equivalence.joint}" if equivalence.joint else "",
            f"{1000 * equivalence.distance:.2g} mm at {equivalence.link}",
            f"{math.degrees(equivalence.angle):.2g} deg at {equivalence.angle_link}",
        )
        for equivalence in checks.equivalences
    ]
    yield "Largest errors at random poses.\n"
    yield from _table([("file", "mass", "joint inertia", "link position", "link rotation"), *rows])


def _joints(robot: "RobotFiles") -> Iterator[str]:
    spec = robot.spec
    if not spec.joint_order:
        return
    yield "## Joints\n"
    yield (
        "In the order of actions, observations and actuators. The source of each number is in "
        "robot.toml."
    )
    if robot.facts.legs:
        yield "The holding torque is the torque at the default pose, and its share of the effort."
    yield ""
    yield from _table(joint_table(robot.facts, spec))
    others = [joint.name for joint in robot.facts.joints if joint.name not in spec.joint_order]
    if others:
        yield f"Not actuated: {cell(', '.join(others))}.\n"


def _simulators(robot: "RobotFiles") -> Iterator[str]:
    orders = robot.facts.simulator_orders
    if not robot.spec.joint_order or not any(order.joints for order in orders):
        return
    yield "## Joint order by simulator\n"
    yield from _table(order_table(robot.facts.file_order, robot.facts.simulator_orders))
    for order in orders:
        certainty = "certain" if order.certain else "to be verified"
        yield f"- {order.simulator} ({certainty}): {cell(order.reason)}"
    yield ""
    actuated = robot.spec.joint_order
    lines = []
    for order in orders:
        simulated = [name for name in order.joints if name in set(actuated)]
        to, back = permutation(actuated, simulated), permutation(simulated, actuated)
        if to is None or back is None:
            continue  # an overriding spec may have other joints
        if to != back or to != list(range(len(to))):
            lines += [f"to_{order.key} = {to}", f"from_{order.key} = {back}"]
    if lines:
        yield (
            "Permutations between the order of robot.toml and the order of a simulator: "
            "`simulator_values = [values[i] for i in to_...]`.\n"
        )
        yield from ("```python", *lines, "```\n")
    else:
        yield "All simulators use the order of robot.toml.\n"


def _findings(result: "OnboardResult") -> Iterator[str]:
    report = result.report
    yield "## Findings\n"
    yield f"**{summarize_findings([report])}** in the source file, after the fixes.\n"
    findings = sorted(report.findings, key=lambda f: (SEVERITIES.index(f.severity), f.code))
    yield from findings_table(group_findings(report.facts.model, findings))
    skipped = [(codes, reason) for _, codes, reason in group_skipped(report.skipped)]
    yield from titled_list("Not checked or ignored", skipped)


def _next_steps(result: "OnboardResult", robot: "RobotFiles") -> Iterator[str]:
    yield "## Next steps\n"
    yield (
        "Edit robot.toml to change body names, the default pose, gains and limits. Run these "
        "commands in this folder.\n"
    )
    urdf, mjcf = (shlex.quote(escape_control(name)) for name in (robot.spec.urdf, robot.spec.mjcf))
    commands = [
        ("view the robot", "python -m mujoco.viewer --mjcf=scene.xml"),
        ("check an edited robot.toml", f"terrainkit check-robot {urdf} --spec robot.toml"),
        ("compare the two files", f"terrainkit check-robot {urdf} --against {mjcf}"),
    ]
    arguments = train_arguments(robot.spec)
    if arguments and "mjlab" in result.configs:
        commands.append(("train the robot in mjlab", f"python {arguments}"))
    yield "```sh"
    for purpose, command in commands:
        yield f"{command}  # {purpose}"
    yield "```\n"
    if result.configs:
        rows = [(files[0], "see its docstring") for files in result.configs.values()]
        yield from titled_list("Framework configurations", rows)
