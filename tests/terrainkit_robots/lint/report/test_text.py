import dataclasses
from pathlib import Path

import pytest

from terrainkit_robots.lint.report.text import format_lines, to_text
from terrainkit_robots.lint.selection import Suppressed


def test_rules_are_headings_sorted_by_severity(report):
    text = to_text([report], verbose=True)
    headings = [
        line for line in text.splitlines() if line.startswith(("error", "warning ", "note "))
    ]
    assert headings == [
        "error INR002 negative-mass",
        "warning JNT007 degrees",
        "note LEG001 legs",
    ]
    assert "  line 12: the mass is -1 kg; expected > 0\n      help: Weigh it.\n" in text


def test_notes_are_one_line_by_default(report, finding):
    message = "position of " + ", ".join(f"joint_{k}" for k in range(40))
    note = finding("LEG001", "legs", "note", message=message)
    both = dataclasses.replace(report, findings=(finding(), note))
    (line,) = [each for each in to_text([both]).splitlines() if each.startswith("note ")]
    assert line.startswith("note LEG001 position of joint_0, joint_1")
    assert line.endswith("...")
    assert len(line) <= 100
    assert "\nnotes in full: --notes\n" in to_text([both])
    full = " ".join(to_text([both], verbose=True).split())
    assert f"note LEG001 legs line 12: {message}" in full
    assert "--notes" not in full


def test_finding_without_line_shows_message_only(report):
    assert "\n  the mass" in to_text([report], verbose=True)


def test_finding_in_another_file_shows_file(report, finding):
    other = dataclasses.replace(report, findings=(finding(file=Path("other.xml")),))
    assert "\n  other.xml:12: the mass" in to_text([other])


def test_likely_finding_is_marked(report):
    assert "line 40: the mass is -1 kg; expected > 0 (likely)\n" in to_text([report])
    assert "\nlikely: the finding depends on a heuristic" in to_text([report])
    proven = dataclasses.replace(report, findings=report.findings[:1])
    assert "likely" not in to_text([proven])


def test_shared_hint_is_printed_once(report, finding):
    same = dataclasses.replace(
        report, findings=tuple(finding(line=i, message=letter) for i, letter in enumerate("abcd"))
    )
    assert to_text([same]).count("help: Weigh it.") == 1
    both = (finding(line=1), finding(line=2, hint="Look."))
    differing = dataclasses.replace(report, findings=both)
    assert "help: Weigh it." in to_text([differing])
    assert "help: Look." in to_text([differing])


def test_notes_have_no_help(report, finding):
    note = finding("LEG001", "legs", "note", hint="Look at the legs.")
    both = dataclasses.replace(report, findings=(finding(), note))
    text = to_text([both])
    assert "Look at the legs." not in text
    assert text.count("help: ") == 1
    assert "\ndetails of a note: terrainkit rule CODE, such as LEG001\n" in text
    assert to_text([both, both]).count("details of a note: ") == 2


def test_no_notes_no_note_help(report, finding):
    assert "details of a note" not in to_text([dataclasses.replace(report, findings=(finding(),))])
    unhelpful = finding("LEG001", "legs", "note", hint="")
    assert "details of a note" in to_text([dataclasses.replace(report, findings=(unhelpful,))])


def test_entries_of_a_rule_are_limited(report, finding):
    many = tuple(finding(line=i, message=f"differs {'x' * i}") for i in range(1, 101))
    text = to_text([dataclasses.replace(report, findings=many)])
    assert text.count("differs") == 10
    assert "and 90 more findings; use --format json for all\n" in text
    assert text.endswith("robot.urdf: 100 errors\n")


def test_repeated_findings_are_one_entry(report, finding):
    many = tuple(
        finding(line=i, subject=f"leg_{i}", message=f"mass of leg_{i}: got -{i} kg; expected > 0")
        for i in range(1, 31)
    )
    text = to_text([dataclasses.replace(report, findings=many)])
    assert "  line 1: mass of leg_1: got -1 kg; expected > 0\n" in text
    assert "      also 29 more: leg_2 (-2), leg_3 (-3), " in text
    assert "leg_13 (-13), and 17 more\n" in text
    assert text.endswith("robot.urdf: 1 error\n")


def test_skipped_rules_are_grouped_by_reason(report):
    text = to_text([report])
    assert "skipped: not a legged robot: 2 rules do not apply\n" in text
    assert "skipped: INR002: suppressed: so\n" in text
    assert "warning: INR999: comment at robot.urdf:3: unknown rule\n" in text


def test_findings_of_one_suppression_are_one_line(report):
    (suppressed,) = [each for each in report.skipped if isinstance(each, Suppressed)]
    text = to_text([dataclasses.replace(report, skipped=(suppressed, suppressed))])
    assert "skipped: INR002: suppressed for hatch, hatch: so\n" in text


def test_last_line_has_counts_and_fixes(report):
    last = to_text([report]).splitlines()[-1]
    assert last == "robot.urdf: 1 error, 2 warnings, 1 note (fixable: 1 with --fix)"


def test_no_findings_are_stated(report):
    clean = dataclasses.replace(report, findings=(), skipped=())
    assert to_text([clean]).endswith("\n\nrobot.urdf: no problems found\n")
    assert "\n\n\n" not in to_text([clean])


def test_several_files_have_total_counts(report):
    assert to_text([report, report]).endswith(
        "\n2 files: 2 errors, 4 warnings, 2 notes (fixable: 2 with --fix)\n"
    )


def test_fixed_and_unfixed_findings_are_listed(fixed_report):
    text = to_text([fixed_report])
    assert "fixed\n  line 12: XML003, calf: name it\n" in text
    assert "not fixed: JNT009 calf: no space\n" in text


def test_control_characters_are_escaped(nasty):
    text = to_text([nasty])
    for line in text.splitlines():
        assert line.isprintable() or not line
    assert "\\x1b[31m" in text
    assert "\\u202e" in text
    text.encode()  # no halves of characters


@pytest.mark.parametrize("width", [60, 80, 100])
def test_lines_fit_the_width(report, finding, width):
    long = dataclasses.replace(
        report, findings=(finding(message="word " * 60, hint="other " * 60, file=Path("x" * 40)),)
    )
    for line in format_lines([long], width):
        assert sum(len(span.text) for span in line) <= width


def test_long_words_are_not_broken(report, finding):
    name = "n" * 150
    long = dataclasses.replace(report, findings=(finding(message=f"link {name} is long"),))
    assert name in to_text([long])


def test_long_messages_are_cut(report, finding):
    long = dataclasses.replace(report, findings=(finding(message="n" * 10**6),))
    assert len(to_text([long])) < 5000


def test_robot_summary_comes_first(report):
    text = to_text([report])
    assert text.startswith("robot.urdf\n  robot     r (URDF)\n  size      0 kg, 0 links in 0 rigid")
