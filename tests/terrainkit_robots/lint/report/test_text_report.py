import dataclasses
from pathlib import Path

import pytest

from terrainkit_robots.lint.check import Suppressed
from terrainkit_robots.lint.report.text_report import format_lines, to_text
from tests.tables import read_table

TEXT = read_table(__file__, "text")


@pytest.fixture
def text_of(report):
    """Return a function that formats a report with these findings."""
    return lambda *findings: to_text([dataclasses.replace(report, findings=findings)])


def test_text_of_a_report(report):
    note = "note LEG004 the mass is -1 kg; expected > 0"
    assert to_text([report]) == TEXT.format(note=note, how="notes in full: --notes\n")
    note = "note LEG004 legs\n  line 1: the mass is -1 kg; expected > 0"
    assert to_text([report], verbose=True) == TEXT.format(note=note, how="")


def test_text_of_a_fixed_report(fixed_report):
    assert to_text([fixed_report]).split("\n\n", 1)[1] == (
        "fixed\n  line 12: XML003, calf: name it\n\n"
        "warning JNT009 unit-axis\n  line 12: the mass is -1 kg; expected > 0\n"
        "      help: Weigh it.\n\n"
        "not fixed: JNT009 calf: no space\n\n"
        "robot.urdf: 1 warning (fixable: 1 with --fix)\n"
    )


def test_text_of_a_report_without_findings(report):
    clean = dataclasses.replace(report, findings=(), skipped=())
    assert to_text([clean]).endswith(
        "none detected; --feet names feet\n\nrobot.urdf: no problems found\n"
    )


def test_brief_report_is_one_line(report, fixed_report):
    assert to_text([report, fixed_report], brief=True) == (
        "robot.urdf: 1 error, 2 warnings, 1 note (fixable: 1 with --fix) [INR002]\n"
        "robot.urdf: 1 warning (fixable: 1 with --fix), 1 finding fixed\n\n"
        "2 files: 1 error, 3 warnings, 1 note (fixable: 2 with --fix)\n"
    )


def test_several_files_have_total_counts(report):
    text = to_text([report, report])
    assert text.startswith(to_text([report]) + "\n" + to_text([report]) + "\n2 files: 2 errors, ")


def test_notes_are_one_line_by_default(text_of, finding):
    message = "position of " + ", ".join(f"joint_{k}" for k in range(40))
    text = text_of(finding(), finding("LEG004", "legs", "note", message=message))
    (line,) = [each for each in text.splitlines() if each.startswith("note ")]
    assert line.startswith("note LEG004 position of joint_0, joint_1")
    assert line.endswith("...")
    assert len(line) <= 100


def test_finding_in_another_file_shows_file(text_of, finding):
    assert "\n  other.xml:12: the mass" in text_of(finding(file=Path("other.xml")))


def test_shared_hint_is_printed_once(text_of, finding):
    same = text_of(*(finding(line=i, message=letter) for i, letter in enumerate("abcd")))
    assert same.count("help: Weigh it.") == 1
    differing = text_of(finding(line=1), finding(line=2, hint="Look."))
    assert differing.count("help: Weigh it.") == differing.count("help: Look.") == 1


def test_entries_of_a_rule_are_limited(text_of, finding):
    for number, more in ((10, 0), (11, 1)):
        text = text_of(*(finding(line=i, message=f"differs {'x' * i}") for i in range(number)))
        assert text.count("differs") == 10
        assert text.count("and 1 more finding; use --format json for all\n") == more


def test_repeated_findings_are_one_entry(text_of, finding):
    numbers = {f"leg_{i}": i for i in range(1, 31)}
    found = [
        finding(line=i, subject=leg, message=f"mass of {leg}: got -{i} kg")
        for leg, i in numbers.items()
    ]
    text = text_of(*found)
    first = "  line 1: mass of leg_1: got -1 kg\n"
    assert f"{first}      also 29 more: leg_2 (-2), leg_3 (-3), " in text
    assert "leg_13 (-13), and 17 more\n" in text
    assert text.endswith("robot.urdf: 1 error\n")


def test_findings_of_one_suppression_are_one_line(report):
    (suppressed,) = [each for each in report.skipped if isinstance(each, Suppressed)]
    text = to_text([dataclasses.replace(report, skipped=(suppressed, suppressed))])
    assert "skipped: INR002: suppressed for hatch, hatch: so\n" in text


def test_control_characters_are_escaped(nasty):
    text = to_text([nasty])
    assert all(line.isprintable() for line in text.splitlines() if line)
    assert "\\x1b[31m" in text
    assert "\\u202e" in text
    text.encode()  # no halves of characters


@pytest.mark.parametrize("width", [60, 100])
def test_lines_fit_the_width(report, finding, width):
    found = finding(message="word " * 60, hint="other " * 60, file=Path("x" * 40))
    lines = format_lines([dataclasses.replace(report, findings=(found,))], width)
    longest = max(sum(len(span.text) for span in line) for line in lines)
    assert width - 6 < longest <= width


def test_long_words_are_not_broken_and_long_messages_are_cut(text_of, finding):
    assert "n" * 150 in text_of(finding(message=f"link {'n' * 150} is long"))
    for length, end in ((2000, "n\n"), (2001, "n\n      ...\n")):
        assert f"{'n' * 2000}{end[1:]}" in text_of(finding(message="n" * length))
