"""Check a robot file: load it, run the selected rules, and leave out suppressed findings."""

from collections.abc import Iterator, Mapping, Sequence, Set
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Literal

from terrainkit.errors import ConfigError
from terrainkit_robots.analysis.facts import Facts
from terrainkit_robots.description.load import load_robot
from terrainkit_robots.lint.rule import Finding, Rule, rules
from terrainkit_robots.lint.runner import Report, Skipped, has_inputs, lint
from terrainkit_robots.lint.settings import Settings, matching, read_settings
from terrainkit_robots.lint.suppressions import SuppressionComment, read_comments
from terrainkit_robots.mesh.mesh_cache import Meshes
from terrainkit_robots.spec.loops import LoopSpec, load_spec, with_loop_spec
from terrainkit_robots.text import display_path, group, names


@dataclass(frozen=True, kw_only=True)
class Suppressed(Skipped):
    """A finding that is suppressed by a comment in the file, or recorded in the baseline file."""

    finding: Finding
    comment: SuppressionComment | None = None
    """None for a finding in the baseline file."""


def select_rules(
    settings: Settings, subject: Literal["robot", "task"] = "robot"
) -> tuple[tuple[Rule, ...], tuple[Skipped, ...]]:
    """Return the rules of robots or of tasks that the settings select.

    Returns:
        Selected rules, and ignored rules with the reasons.

    Raises:
        ConfigError: if the settings name an unknown rule.
    """
    named = {rule for word in settings.select for rule in matching(word)}
    reasons = {
        rule.code: reason for word, reason in settings.ignore.items() for rule in matching(word)
    }
    candidates = [rule for rule in rules(subject) if rule in named or not settings.select]
    selected = tuple(rule for rule in candidates if rule.code not in reasons)
    ignored = tuple(
        Skipped(code=rule.code, kind="ignored", reason=f"ignored: {reasons[rule.code]}")
        for rule in candidates
        if rule.code in reasons
    )
    return selected, ignored


def lint_selected(
    facts: Facts, settings: Settings, contents: Mapping[Path, bytes] | None = None
) -> Report:
    """Return the report of the selected rules on a robot, without suppressed findings.

    Args:
        facts: The robot.
        settings: Which rules to run. If they select none by name, all whose inputs are available.
        contents: Bytes that replace the content of files, by path.

    Raises:
        ConfigError: if the settings name an unknown rule.
    """
    selected, ignored = select_rules(settings)
    simulate = settings.simulate is not False
    if not settings.select:
        selected = tuple(r for r in selected if has_inputs(r, facts, simulate=simulate))
    report = lint(facts, selected, simulate=simulate)
    comments = [
        comment
        for file in facts.model.sources
        for comment in read_comments(file, (contents or {}).get(file))
    ]
    kept, suppressed = _apply_suppressions(report, comments)
    completed = frozenset(r.code for r in selected) - {s.code for s in report.skipped}
    unused = _unused_suppressions(comments, completed, suppressed)
    return replace(
        report,
        findings=tuple(kept),
        skipped=(*report.skipped, *ignored, *suppressed, *unused),
        completed=completed,
    )


def _apply_suppressions(
    report: Report, comments: Sequence[SuppressionComment]
) -> tuple[list[Finding], list[Suppressed]]:
    """Split the findings of a report into remaining and suppressed findings."""
    by_rule = group(((c.file, c.code), c) for c in comments if c.error is None)
    kept: list[Finding] = []
    suppressed: list[Suppressed] = []
    for finding in report.findings:
        candidates = by_rule.get((finding.file, finding.code), ())
        comment = next((c for c in candidates if c.applies_to(finding.line)), None)
        if comment is None:
            kept.append(finding)
            continue
        location = f"{finding.file.name}:{finding.line}"
        target = f"{finding.subject} ({location})" if finding.subject else location
        reason = f"suppressed for {target}: {comment.reason}"
        suppressed.append(
            Suppressed(
                code=finding.code,
                kind="suppressed",
                reason=reason,
                finding=finding,
                comment=comment,
            )
        )
    return kept, suppressed


def _unused_suppressions(
    comments: Sequence[SuppressionComment], completed: Set[str], suppressed: Sequence[Suppressed]
) -> Iterator[Skipped]:
    """Yield the comments that suppress nothing although their rule ran."""
    used = {id(finding.comment) for finding in suppressed}
    for comment in comments:
        error = comment.error
        if error is None and comment.code in completed and id(comment) not in used:
            error = f"unused suppression: {comment.code} has no finding here"
        if error is not None:
            reason = f"comment at {display_path(comment.file)}:{comment.line}: {error}"
            yield Skipped(code=comment.code, kind="unused", reason=reason)


def check_robot(
    path: str | Path,
    settings: Settings | None = None,
    *,
    against: str | Path | None = None,
    spec: str | Path | LoopSpec | None = None,
    contents: Mapping[Path, bytes] | None = None,
) -> Report:
    """Return what the lint rules find in a robot file.

    Args:
        path: A URDF, xacro or MJCF file, or the name of a robot; see `find_robot`.
        settings: Selected rules, ROS packages and xacro arguments. By default they are read from
            the nearest terrainkit.toml or pyproject.toml in the folder of the file or above it;
            for a name, in the working directory or above it.
        against: Another file of the same robot, to compare with.
        spec: The robot.toml of the robot, to compare with; or only the loops of one.
        contents: Bytes to read instead of the files at these paths, such as the result of a fix.

    Returns:
        The report, with the facts of the robot, the findings and the rules that were skipped.

    Raises:
        RobotFileError: if a file cannot be found, downloaded or opened.
        ConfigError: if the settings name an unknown rule or links that end no legs, `against` is
            not a robot, or the spec is invalid or its loops do not fit the robot.
    """
    path, contents = Path(path), contents or {}
    if settings is None:
        settings = read_settings(path.parent)
    packages, arguments = settings.packages, settings.xacro_arguments
    other = None
    if against is not None:
        model = load_robot(against, packages=packages, xacro_arguments=arguments)
        if not model.links:
            reason = f": {model.problems[0].message}" if model.problems else ""
            raise ConfigError(f"{against} does not describe a robot{reason}")
        other = Facts(model)
    robot_spec, loop_spec = None, spec if isinstance(spec, LoopSpec) else LoopSpec()
    if isinstance(spec, str | Path):
        robot_spec, loop_spec = load_spec(spec)
    model = load_robot(path, packages=packages, xacro_arguments=arguments, contents=contents)
    model = with_loop_spec(replace(model, feet=settings.feet), loop_spec)
    facts = Facts(model, Meshes(contents), against=other, spec=robot_spec)
    feet = {leg.foot for leg in facts.legs}
    if wrong := [foot for foot in settings.feet if foot not in feet]:
        ends = names(facts.bodies[limb.chain[-1]].name for limb in facts.limbs)
        raise ConfigError(
            f"feet: got {names(wrong)}; expected one link for each leg, at the end of a chain with "
            f"at least two actuated joints: {ends or 'the robot has none'}"
        )
    return lint_selected(facts, settings, contents)
