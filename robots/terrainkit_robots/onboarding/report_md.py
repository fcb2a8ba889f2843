"""The report on a robot that was brought in: report.md, for people and for pull requests."""

import math
import shlex
from collections.abc import Iterator, Sequence
from pathlib import PurePath
from typing import TYPE_CHECKING

from terrainkit_robots.analysis.bodies.joint_order import permutation
from terrainkit_robots.analysis.simulator_conventions.joint_order import simulator_orders
from terrainkit_robots.analysis.simulator_conventions.order_table import order_table
from terrainkit_robots.lint.report.escape import escape_control, escape_surrogates
from terrainkit_robots.lint.report.grouping import group_findings
from terrainkit_robots.lint.report.markdown import cell, finding_row, titled_list
from terrainkit_robots.lint.report.summary import group_skipped, summarize_findings
from terrainkit_robots.onboarding.joint_rows import joint_rows, shown
from terrainkit_robots.text import count

if TYPE_CHECKING:
    from terrainkit_robots.lint.runner import Finding
    from terrainkit_robots.onboarding.pipeline import BroughtIn
    from terrainkit_robots.onboarding.robot_files import Onboarded
    from terrainkit_robots.onboarding.verify import Proof
    from terrainkit_robots.simulation.standing import Standing


def report_page(done: "BroughtIn") -> str:
    """Return the page, in Markdown.

    Args:
        done: A robot that was brought in; there is no page of one that was kept out.
    """
    assert done.made is not None
    made = done.made
    sections = (
        _head(done, made),
        _changes(done, made),
        _standing(done.proof, made),
        _agreement(done.proof),
        _joints(made),
        _orders(made),
        _findings(done),
        _next(done, made),
    )
    return escape_surrogates("\n".join(line for section in sections for line in section))


def _table(rows: Sequence[Sequence[str]]) -> Iterator[str]:
    """Yield a table; the first row is its header."""
    for index, row in enumerate(rows):
        yield f"| {' | '.join(map(cell, row))} |"
        if index == 0:
            yield "|---" * len(row) + "|"
    yield ""


# The robot


def _head(done: "BroughtIn", made: "Onboarded") -> Iterator[str]:
    yield f"# {cell(made.spec.name)}\n"
    if done.pictures:
        titles = [PurePath(name).stem for name in done.pictures]
        yield f"| {' | '.join(map(cell, titles))} |"
        yield "|---" * len(titles) + "|"
        shots = [f"![{cell(t)}]({n})" for t, n in zip(titles, done.pictures, strict=True)]
        yield f"| {' | '.join(shots)} |\n"
    elif done.no_pictures:
        yield f"No pictures: {cell(done.no_pictures)}.\n"
    yield " ".join(_summary(made)) + "\n"


def _summary(made: "Onboarded") -> Iterator[str]:
    facts, spec = made.facts, made.spec
    joints = count(len(spec.joint_order), "actuated joint")
    bodies = sum(not body.virtual for body in facts.bodies)
    rigid = f"{bodies:,} rigid {'body' if bodies == 1 else 'bodies'}"
    mass = f"weighs {shown(facts.total_mass, 4)} kg and " if _known(facts.total_mass) else ""
    yield f"{cell(spec.name)} {mass}has {rigid} and {joints}."
    moves = "moves freely" if spec.floating else "is fixed to the world"
    yield f"Its base, {cell(spec.base)}, {moves}."
    if not facts.legs:
        yield (
            "No legs were found: it has no feet, no standing pose and no spawn height, and the "
            "rules for legs were not asked."
        )
        return
    feet = ", ".join(map(cell, spec.feet))
    length = f", {shown(spec.leg_length)} m long" if _known(spec.leg_length) else ""
    yield f"It stands on {count(len(facts.legs), 'leg')}{length}: {feet}."
    height = facts.stance.height if facts.stance is not None else None
    measures = (
        ("its base is {} m above the ground", height),
        ("it is let go at {} m", spec.spawn_height),
        ("its feet are {} m apart", spec.stance_width),
    )
    told = [words.format(shown(value)) for words, value in measures if _known(value)]
    if told:
        yield f"Standing, {', '.join(told)}."


def _known(value: float | None) -> bool:
    return value is not None and math.isfinite(value)


# What was done


def _changes(done: "BroughtIn", made: "Onboarded") -> Iterator[str]:
    yield "## What was done\n"
    yield f"Read from {cell(str(done.report.facts.model.file))}, which was not changed.\n"
    yield from titled_list("Repaired in what is written here", [_repair(f) for f in done.repaired])
    if made.notes:
        yield "Left out, changed or made:\n"
        yield from (f"- {cell(note)}" for note in made.notes)
        yield ""
    if not (done.repaired or made.notes):
        yield "Nothing had to be repaired, left out or changed.\n"


def _repair(finding: "Finding") -> tuple[str, str]:
    what = finding.message if finding.fix is None else finding.fix.description
    return finding.code, f"{finding.subject}: {what}" if finding.subject else what


# What was proved


def _standing(proof: "Proof | None", made: "Onboarded") -> Iterator[str]:
    if not made.facts.legs:
        return
    yield "## Standing\n"
    if proof is None or proof.standing is None:
        why = f": {cell(proof.unknown)}" if proof is not None and proof.unknown else ""
        yield f"It was not simulated{why}.\n"
        return
    seen = proof.standing
    how = "with its joints locked" if proof.locked else "at its default pose, with the gains below"
    verdict = "It stands" if proof.stood else "It does not stand"
    yield f"**{verdict}**, {how}, in MuJoCo:\n"
    slides = any(joint.kind == "prismatic" for joint in made.facts.joints)
    unit = "rad or m" if slides else "rad"
    yield from _table([("what", "measured"), *_seen(seen, unit, locked=proof.locked)])


def _seen(seen: "Standing", unit: str, *, locked: bool) -> Iterator[tuple[str, str]]:
    blew_up = "; then its numbers blew up" if seen.blew_up else ""
    yield "simulated", f"{shown(seen.seconds)} s{blew_up}"
    tilts = (shown(math.degrees(tilt), 2) for tilt in (seen.tilt, seen.largest_tilt))
    yield "tilt", "{} deg at the end, {} deg at most".format(*tilts)
    sink = f"{1000 * seen.sink:.1f} mm below the start"
    yield "height of the base", f"{shown(seen.height)} m at the end, {sink}"
    yield "drift", f"{1000 * seen.drift:.1f} mm"
    yield "touched the ground", ", ".join(seen.touching) or "only the feet"
    if locked:
        return
    if seen.saturated:
        yield "largest torque", f"{seen.saturation:.0%} of the effort of {seen.saturated}"
    yield "farthest joint from its target", f"{shown(seen.joint_error, 2)} {unit}"


def _agreement(proof: "Proof | None") -> Iterator[str]:
    if proof is None or not proof.agreements:
        return
    yield "## The files against their source\n"
    rows = [
        (
            each.file,
            f"{each.mass:+.3%}",
            f"{each.inertia:.3%} at {each.joint}" if each.joint else "",
            f"{1000 * each.distance:.2g} mm at {each.link}",
            f"{math.degrees(each.angle):.2g} deg at {each.turned}",
        )
        for each in proof.agreements
    ]
    head = ("file", "mass", "inertia that a joint carries", "farthest link", "most turned link")
    yield from _table([head, *rows])


# Joints


def _joints(made: "Onboarded") -> Iterator[str]:
    spec = made.spec
    if not spec.joint_order:
        return
    yield "## Joints\n"
    yield (
        "In the order of actions, observations and actuators. Where each number came from is in "
        "robot.toml."
    )
    if made.facts.legs:
        yield "What a joint holds is its torque at the default pose, and the share of its effort."
    yield ""
    yield from _table(joint_rows(made.facts, spec))
    others = [joint.name for joint in made.facts.joints if joint.name not in spec.joint_order]
    if others:
        yield f"Not driven by a motor: {cell(', '.join(others))}.\n"


def _orders(made: "Onboarded") -> Iterator[str]:
    orders = simulator_orders(made.facts)
    if not made.spec.joint_order or not any(order.joints for order in orders):
        return
    yield "## Joint order by simulator\n"
    yield from _table(order_table(made.facts))
    for order in orders:
        sure = "certain" if order.certain else "to be verified"
        yield f"- {order.simulator} ({sure}): {cell(order.reason)}"
    yield ""
    driven = made.spec.joint_order
    lines = []
    for order in orders:
        there = [name for name in order.joints if name in set(driven)]
        to, back = permutation(driven, there), permutation(there, driven)
        if to is None or back is None:
            continue  # a spec of the user's own may have other joints
        if to != back or to != list(range(len(to))):
            lines += [f"to_{order.key} = {to}", f"from_{order.key} = {back}"]
    if lines:
        yield "From the order of robot.toml and back: `there = [here[i] for i in to_...]`.\n"
        yield from ("```python", *lines, "```\n")
    else:
        yield "All of them have the actuated joints in the order of robot.toml.\n"


# What is left to do


def _findings(done: "BroughtIn") -> Iterator[str]:
    report = done.report
    yield "## Findings\n"
    yield f"**{summarize_findings([report])}** in the robot as it was read, repairs made.\n"
    if report.findings:
        yield "| | rule | where | what | what to do |\n|---|---|---|---|---|"
        groups = group_findings(report.facts.model, report.findings)
        yield from (finding_row(group) for group in groups)
        yield ""
    skipped = [(codes, reason) for _, codes, reason in group_skipped(report.skipped)]
    yield from titled_list("Not checked, or ignored", skipped)


def _next(done: "BroughtIn", made: "Onboarded") -> Iterator[str]:
    yield "## Next steps\n"
    yield (
        "robot.toml is yours to edit: names of bodies, pose, gains, limits. The commands are for "
        "this folder.\n"
    )
    spec = made.spec
    commands = [
        ("look at it", "python -m mujoco.viewer --mjcf=scene.xml"),
        ("check what you edited", f"terrainkit check-robot {_word(spec.urdf)} --spec robot.toml"),
        (
            "compare the two files",
            f"terrainkit check-robot {_word(spec.urdf)} --against {_word(spec.mjcf)}",
        ),
    ]
    yield "```sh"
    for what, command in commands:
        yield f"{command}  # {what}"
    yield "```\n"
    if done.configs:
        yield from titled_list(
            "Configurations", [(name, "start from here") for name in done.configs]
        )


def _word(name: str) -> str:
    return shlex.quote(escape_control(name))
