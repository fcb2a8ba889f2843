"""What onboarding says about a robot: statements, for the terminal and for report.md.

Each step makes one statement, which has a line for the terminal, lines of Markdown, or both. The
terminal prints them in the order of the steps; report.md has them by section.
"""

import math
import shlex
from collections.abc import Iterable, Iterator, Sequence
from dataclasses import dataclass
from pathlib import PurePath

from terrainkit_robots.analysis.bodies.permutation import permutation
from terrainkit_robots.analysis.legs.closed_loops import largest_gap
from terrainkit_robots.analysis.simulator_conventions.joint_order import order_table
from terrainkit_robots.lint.report.escape import escape_control, escape_surrogates
from terrainkit_robots.lint.report.grouping import group_findings
from terrainkit_robots.lint.report.markdown import cell, findings_table, titled_list
from terrainkit_robots.lint.report.summary import group_skipped, summarize_findings
from terrainkit_robots.lint.rule import SEVERITIES, Finding
from terrainkit_robots.onboarding.comparison import NUM_STATES, error_text
from terrainkit_robots.onboarding.convert import RobotFiles
from terrainkit_robots.onboarding.frameworks.frameworks import reads_mjcf
from terrainkit_robots.onboarding.frameworks.mjlab import train_arguments
from terrainkit_robots.onboarding.joint_table import format_number, joint_table
from terrainkit_robots.onboarding.result import PUBLISHED, OnboardResult
from terrainkit_robots.onboarding.verify import Verification
from terrainkit_robots.simulation.assessment import assess
from terrainkit_robots.simulation.standing import StandResult
from terrainkit_robots.text import count, display_path, names

_MAX_GAP = 0.001
"""Distance of the two ends of a loop above which it is open [m]."""

_HEADINGS = {
    "pictures": "",
    "robot": "",
    "changes": "Changes",
    "standing": "Standing test",
    "responses": "Step responses",
    "comparison": "Comparison with the source",
    "joints": "Joints",
    "orders": "Joint order by simulator",
    "findings": "Findings",
    "next": "Next steps",
}
"""The sections of report.md and their headings."""


@dataclass(frozen=True)
class Statement:
    """What is said about one step."""

    section: str
    """Section of report.md, a key of `_HEADINGS`."""

    lines: Iterable[str] = ()
    """Lines of Markdown. An iterator is read at most once."""

    label: str = ""
    """Label of the line in the terminal; without one there is no line."""

    text: str = ""
    """The line in the terminal."""


def summarize(result: OnboardResult) -> Iterator[tuple[str, str]]:
    """Yield the label and the text of each line for the terminal."""
    return ((said.label, said.text) for said in statements(result) if said.label)


def report_markdown(result: OnboardResult) -> str:
    """Return the text of report.md for a robot that was written."""
    assert result.robot is not None
    sections: dict[str, list[str]] = {name: [] for name in _HEADINGS}
    for statement in statements(result):
        sections[statement.section] += statement.lines
    lines = [f"# {cell(result.robot.spec.name)}\n"]
    for name, own in sections.items():
        lines += [f"## {_HEADINGS[name]}\n", *own] if _HEADINGS[name] and own else own
    return escape_surrogates("\n".join(lines))


def statements(result: OnboardResult) -> Iterator[Statement]:
    """Yield what is said about a robot, in the order of the steps."""
    report = result.report
    yield Statement("findings", _findings(result), "checked", summarize_findings([report]))
    yield from _fixes(result)
    robot, checks = result.robot, result.verification
    if robot is None or checks is None:
        return
    yield Statement("robot", _properties(robot), "wrote", _list_files(robot))
    yield from _comparison(checks)
    yield from _loops(result, robot)
    if checks.standing is not None and (text := result.unjudged):
        yield Statement("standing", [f"Its standing is {text}.\n"], "standing", text)
    else:
        yield from _standing(checks, robot)
    yield from _responses(checks)
    yield Statement("joints", _joints(robot))
    yield Statement("orders", _simulators(robot))
    yield Statement("next", _commands(result, robot))
    yield from _configs(result)
    pictures = f"{count(len(result.images), 'picture')} in report.md"
    if result.images_error:
        pictures = f"none{' of the robot' if result.images else ''}: {result.images_error}"
    yield Statement("pictures", _pictures(result), "pictures", pictures)
    if result.edits:
        edits = names(result.edits)
        text = f"your edits are in {edits}; use --spec to apply the values of a spec"
        yield Statement("changes", (), "backups", text)
    if num_missing := sum(f.onboarding == "repairs" and f.family == "MSH" for f in report.findings):
        text = "mesh is" if num_missing == 1 else "meshes are"
        text += " missing; set the folder of a package with --package NAME=DIR"
        yield Statement("findings", (), "missing", f"{num_missing} {text}")
    if robot.changes:
        lines = ("Omitted, changed or added:\n", *(f"- {cell(c)}" for c in robot.changes), "")
        changes = f"{count(len(robot.changes), 'change')} listed in report.md"
        yield Statement("changes", lines, "notes", changes)
    elif not result.fixed:
        yield Statement("changes", ["Nothing was fixed, omitted or changed.\n"])


# Check and repair


def _findings(result: OnboardResult) -> Iterator[str]:
    report = result.report
    yield f"**{summarize_findings([report])}** in the source file, after the fixes.\n"
    findings = sorted(report.findings, key=lambda f: (SEVERITIES.index(f.severity), f.code))
    yield from findings_table(group_findings(report.facts.model, findings))
    skipped = [(codes, reason) for _, codes, reason in group_skipped(report.skipped)]
    yield from titled_list("Not checked or ignored", skipped)


def _fixes(result: OnboardResult) -> Iterator[Statement]:
    """Yield what was fixed, and the repairs of inertias and mesh paths, which change the robot."""
    yield Statement("changes", _source(result))
    if not result.fixed:
        return
    codes = dict.fromkeys(finding.code for finding in result.fixed)
    text = f"{count(len(result.fixed), 'finding')}: {names(codes)}"
    yield Statement("changes", _fixed(result.fixed), "fixed", text)
    for family in ("INR", "MSH"):
        fixes = [f.fix for f in result.fixed if f.family == family and f.fix is not None]
        texts = [fix.description.rstrip(".") for fix in fixes]
        if texts:
            more = f"; {len(texts) - 3} more" if texts[3:] else ""
            text = f"{'; '.join(texts[:3])}{more}; see report.md"
            yield Statement("changes", (), "repaired", text)


def _source(result: OnboardResult) -> Iterator[str]:
    file = cell(display_path(result.report.facts.model.file))
    yield f"The source is {file}; it was not changed.\n"


def _fixed(fixed: Sequence[Finding]) -> Iterator[str]:
    rows = []
    for finding in fixed:
        text = finding.message if finding.fix is None else finding.fix.description
        rows.append((finding.code, f"{finding.subject}: {text}" if finding.subject else text))
    return titled_list("Fixed in the written files", rows)


# Convert


def _list_files(robot: RobotFiles) -> str:
    meshes = [data for name, data in robot.files.items() if "/" in name]
    texts = [name for name in robot.files if "/" not in name]
    size = sum(map(len, meshes)) / 1e6
    more = f", {count(len(meshes), 'mesh file')} ({size:.1f} MB)" if meshes else ""
    return f"{names(texts)}{more}"


def _properties(robot: RobotFiles) -> Iterator[str]:
    yield " ".join(_sentences(robot)) + "\n"


def _sentences(robot: RobotFiles) -> Iterator[str]:
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
            "the rules for legs were skipped. --feet names the feet of a robot with legs."
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


def _joints(robot: RobotFiles) -> Iterator[str]:
    spec = robot.spec
    if not spec.joint_order:
        return
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


def _simulators(robot: RobotFiles) -> Iterator[str]:
    orders = robot.facts.simulator_orders
    if not robot.spec.joint_order or not any(order.joints for order in orders):
        return
    yield from _table(order_table(robot.facts.file_order, orders))
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


def _table(rows: Sequence[Sequence[str]]) -> Iterator[str]:
    """Yield the lines of a table; the first row is its header."""
    for index, row in enumerate(rows):
        yield f"| {' | '.join(map(cell, row))} |"
        if index == 0:
            yield "|---" * len(row) + "|"
    yield ""


# Verify


def _comparison(checks: Verification) -> Iterator[Statement]:
    """Yield the largest errors, and one line for each difference from the source."""
    errors = {compared.file: compared.errors for compared in checks.comparisons}
    if errors:
        found = "differ from" if checks.differences else "match"
        text = f"{' and '.join(errors)} {found} the source at {NUM_STATES} states"
        for what in ("link position", "mass matrix"):
            error = max(of_file.get(what, (0.0, "")) for of_file in errors.values())
            text += f", {what} within {error_text(what, (error[0], ''))}"
        lines = f"Largest errors at {NUM_STATES} random states, relative unless with a unit.\n"
        rows = [["file", *errors]]
        for what in dict.fromkeys(what for of_file in errors.values() for what in of_file):
            cells = (error_text(what, of_file.get(what, (0.0, ""))) for of_file in errors.values())
            rows.append([what, *cells])
        yield Statement("comparison", (lines, *_table(rows)), "compared", text)
    for text in checks.differences:
        yield Statement("comparison", [f"- {cell(text)}\n"], "differs", text)
    if checks.uncompared:
        text = f"springs, constraints and actuators were not compared: {checks.uncompared}"
        yield Statement("comparison", [f"- {cell(text)}\n"], "compared", text)


def _loops(result: OnboardResult, robot: RobotFiles) -> Iterator[Statement]:
    """Yield whether the closed loops are closed, which joints move them, and who lacks them."""
    facts = robot.facts
    if not facts.loops:
        return
    gap = largest_gap(facts, facts.default_pose)
    loops = count(len(facts.model.loops), "loop")
    text = f"{loops} closed within {1000 * gap:.2g} mm at the default pose"
    if gap > _MAX_GAP:
        text = f"NO: {loops} open by up to {1000 * gap:.3g} mm at the default pose"
    moved = {joint.name for joint in facts.joints if joint.coupled and joint.mimic is None}
    if moved <= set(robot.spec.joint_order):
        text += "; all their joints have motors, unless joint_order of --spec names those that have"
    if without := [name for name in result.configs if not reads_mjcf(name)]:
        text += f"; robot.urdf, which {names(without)} reads, has none, and its rods hang loose"
    yield Statement("comparison", [f"Loops: {cell(text)}.\n"], "loops", text)


def _standing(checks: Verification, robot: RobotFiles) -> Iterator[Statement]:
    text, lines = _standing_text(checks, robot), []
    if robot.facts.legs:
        lines = [f"{cell(text[0].upper() + text[1:])}.\n"]
    if checks.standing is not None:
        has_slides = any(joint.kind == "prismatic" for joint in robot.facts.joints)
        unit = "rad or m" if has_slides else "rad"
        rows = _standing_rows(checks.standing, unit, locked=checks.joints_locked)
        lines += _table([("quantity", "value"), *rows])
    yield Statement("standing", lines, "standing", text)
    if checks.free_standing is None:
        return
    failures = assess(checks.free_standing).failures
    how = f"{checks.free_standing.seconds:g} s with the gains of robot.toml and without a policy"
    text = f"no, a policy has to balance it: {how}; {failures[0]}" if failures else f"yes: {how}"
    yield Statement("standing", [f"With free joints: {cell(text)}.\n"], "free", text)


def _responses(checks: Verification) -> Iterator[Statement]:
    if not checks.responses:
        return
    failed = [f"{found.joint} {found.failure}" for found in checks.responses if found.failure]
    rise, overshoot = (
        max(getattr(r, n) for r in checks.responses) for n in ("rise_time", "overshoot")
    )
    text = (
        f"joints reach 90 % of a step within {rise:.2g} s and overshoot by at most {overshoot:.0%}"
    )
    if failed:
        text = f"NO: {names(failed, max_count=3)}"
    rows = [("joint", "90 % after", "overshoot", "error after 1 s")]
    for found in checks.responses:
        numbers = f"{found.rise_time:.3g} s", f"{found.overshoot:.0%}", f"{found.error:.0%}"
        rows.append((found.joint, *numbers))
    intro = "Steps of 0.2 rad or 0.02 m of one target at a time, with the base held in the air.\n"
    yield Statement("responses", (intro, *_table(rows)), "responds", text)


def _standing_text(checks: Verification, robot: RobotFiles) -> str:
    standing = checks.standing
    if checks.error or checks.skipped:
        return f"not simulated: {checks.error or checks.skipped}"
    if standing is None:
        return f"not simulated: the robot has {'a fixed base' if robot.facts.legs else 'no legs'}"
    how = "with the gains of robot.toml"
    if checks.joints_locked:
        how = "with locked joints, since bipeds need a controller to balance"
    if checks.stand_gains:
        how = "with suggested gains, which hold the pose without a policy"
    if checks.failures:
        return f"NO: {standing.seconds:g} s {how}; {'; '.join(checks.failures)}"
    tilt = f"tilt {math.degrees(standing.tilt):.1f} degrees"
    return f"yes: {standing.seconds:g} s {how}, {tilt}, only the feet touch the ground"


def _standing_rows(standing: StandResult, unit: str, *, locked: bool) -> Iterator[tuple[str, str]]:
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


# Report


def _pictures(result: OnboardResult) -> Iterator[str]:
    rendered = [name for name in result.images if name != PUBLISHED]
    if rendered:
        titles = [PurePath(name).stem for name in rendered]
        images = [f"![{cell(t)}]({n})" for t, n in zip(titles, rendered, strict=True)]
        yield f"| {' | '.join(map(cell, titles))} |"
        yield "|---" * len(titles) + "|"
        yield f"| {' | '.join(images)} |\n"
    elif result.images_error:
        yield f"No pictures: {cell(result.images_error)}.\n"
    if PUBLISHED in result.images:
        yield f"![Masses, limits and gains among those of published robots]({PUBLISHED})\n"


def _configs(result: OnboardResult) -> Iterator[Statement]:
    """Yield the configurations of frameworks, and those that were skipped."""
    if result.configs:
        rows = [(files[0], "see its docstring") for files in result.configs.values()]
        listed = names(file for files in result.configs.values() for file in files)
        yield Statement("next", titled_list("Framework configurations", rows), "configs", listed)
    for framework, reason in result.skipped_configs.items():
        yield Statement("next", (), "skipped", f"{framework}: {reason}")


def _commands(result: OnboardResult, robot: RobotFiles) -> Iterator[str]:
    yield (
        "Edit robot.toml to change body names, the default pose, gains and limits. Run these "
        "commands in this folder.\n"
    )
    urdf, mjcf = (shlex.quote(escape_control(name)) for name in (robot.spec.urdf, robot.spec.mjcf))
    yield "```sh"
    yield "python -m mujoco.viewer --mjcf=scene.xml  # view the robot"
    yield f"terrainkit check-robot {urdf} --spec robot.toml  # check an edited robot.toml"
    yield f"terrainkit check-robot {urdf} --against {mjcf}  # compare the two files"
    arguments = train_arguments(robot.spec)
    if arguments and "mjlab" in result.configs:
        yield f"python {arguments}  # train the robot in mjlab"
    yield "```\n"
