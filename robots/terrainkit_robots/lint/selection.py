"""Selection: which rules are asked, and which of their findings are told to be quiet."""

from collections.abc import Iterator, Mapping, Sequence, Set
from dataclasses import dataclass, replace
from pathlib import Path
from typing import TYPE_CHECKING

from terrainkit_robots.lint.rule import Rule, rules
from terrainkit_robots.lint.runner import Finding, Report, Skipped, is_applicable, lint
from terrainkit_robots.lint.settings import Settings, matching
from terrainkit_robots.lint.suppressions import SuppressionComment, read_comments

if TYPE_CHECKING:
    from terrainkit_robots.analysis.facts import Facts


@dataclass(frozen=True, kw_only=True)
class Suppressed(Skipped):
    """A finding that a comment in the file quiets."""

    finding: Finding
    comment: SuppressionComment


@dataclass(frozen=True, kw_only=True)
class UnusedSuppression(Skipped):
    """A comment that quiets nothing; `reason` says where it is, and why."""


def select_rules(settings: Settings) -> tuple[tuple[Rule, ...], tuple[Skipped, ...]]:
    """Return the rules to ask, and those that are left out for a reason.

    Raises:
        ConfigError: if a word stands for no rule.
    """
    selected = {rule for word in settings.select for rule in matching(word)}
    reasons = {
        rule.code: reason for word, reason in settings.ignore.items() for rule in matching(word)
    }
    wanted = [rule for rule in rules() if rule in selected or not settings.select]
    chosen = tuple(rule for rule in wanted if rule.code not in reasons)
    left_out = tuple(
        Skipped(code=rule.code, reason=f"ignored: {reasons[rule.code]}")
        for rule in wanted
        if rule.code in reasons
    )
    return chosen, left_out


def lint_selected(
    facts: "Facts", settings: Settings, contents: Mapping[Path, bytes] | None = None
) -> Report:
    """Return what the chosen rules find on a robot, without what its comments quiet.

    Args:
        facts: The robot.
        settings: Which rules are asked.
        contents: What was read instead of the files of these paths.

    Raises:
        ConfigError: if the settings name a rule that there is not.
    """
    chosen, left_out = select_rules(settings)
    if not settings.select:
        chosen = tuple(r for r in chosen if is_applicable(r, facts, simulate=settings.simulate))
    report = lint(facts, chosen, simulate=settings.simulate)
    comments = [
        comment
        for file in facts.model.sources
        for comment in read_comments(file, (contents or {}).get(file))
    ]
    kept, ignored = _quieted(report, comments)
    unable = {skipped.code for skipped in report.skipped}
    asked = {rule.code for rule in chosen} - unable
    idle = _idle(comments, asked, ignored)
    return replace(
        report, findings=tuple(kept), skipped=(*report.skipped, *left_out, *ignored, *idle)
    )


def _quieted(
    report: Report, comments: Sequence[SuppressionComment]
) -> tuple[list[Finding], list[Suppressed]]:
    """Return the findings that are left, and those that comments quiet."""
    by_code: dict[tuple[Path, str], list[SuppressionComment]] = {}
    for comment in comments:
        if comment.mistake is None:
            by_code.setdefault((comment.file, comment.code), []).append(comment)
    kept: list[Finding] = []
    ignored: list[Suppressed] = []
    for finding in report.findings:
        near = by_code.get((finding.file, finding.code), ())
        covering = next((c for c in near if c.covers(finding.line)), None)
        if covering is None:
            kept.append(finding)
            continue
        why = f"ignored for {_place(finding)}: {covering.reason}"
        ignored.append(Suppressed(code=finding.code, reason=why, finding=finding, comment=covering))
    return kept, ignored


def _place(finding: Finding) -> str:
    where = f"{finding.file.name}:{finding.line}"
    return f"{finding.subject} ({where})" if finding.subject else where


def _idle(
    comments: Sequence[SuppressionComment], asked: Set[str], ignored: Sequence[Suppressed]
) -> Iterator[UnusedSuppression]:
    """Yield the comments that quiet nothing, although their rule was asked."""
    used = {id(each.comment) for each in ignored}
    for comment in comments:
        why = comment.mistake
        if why is None and comment.code in asked and id(comment) not in used:
            why = f"there is no {comment.code} to ignore here"
        if why is not None:
            reason = f"comment at {comment.file}:{comment.line}: {why}"
            yield UnusedSuppression(code=comment.code, reason=reason)
