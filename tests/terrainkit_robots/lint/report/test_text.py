import dataclasses
from pathlib import Path

import pytest

from terrainkit_robots.lint.report.text import lines, write


def test_each_rule_has_a_heading_with_its_findings_below_and_the_worst_comes_first(report):
    text = write([report])
    headings = [
        line for line in text.splitlines() if line.startswith(("error", "warning ", "note"))
    ]
    assert headings == [
        "error INR002 negative-mass",
        "warning JNT007 degrees",
        "note LEG001 legs",
    ]
    assert "  robot.urdf:12: the mass is -1 kg; wanted above 0\n      help: Weigh it.\n" in text


def test_a_finding_of_the_whole_file_has_no_line(report):
    assert "\n  robot.urdf: the mass" in write([report])


def test_a_guess_is_called_one(report):
    assert "robot.urdf:40: the mass is -1 kg; wanted above 0 (likely)\n" in write([report])


def test_a_hint_that_several_findings_share_is_printed_once(report, finding):
    same = dataclasses.replace(report, findings=tuple(finding(line=i) for i in range(1, 5)))
    assert write([same]).count("help: Weigh it.") == 1
    both = (finding(line=1), finding(line=2, hint="Look."))
    differing = dataclasses.replace(report, findings=both)
    assert "help: Weigh it." in write([differing])
    assert "help: Look." in write([differing])


def test_notes_have_no_help_and_one_line_says_where_it_is(report, finding):
    note = finding("LEG001", "legs", "info", hint="Look at the legs.")
    both = dataclasses.replace(report, findings=(finding(), note))
    text = write([both])
    assert "Look at the legs." not in text
    assert text.count("help: ") == 1
    assert "\nabout a note: terrainkit rule CODE, for example terrainkit rule LEG001\n" in text
    assert write([both, both]).count("about a note: ") == 2


def test_without_notes_no_line_says_where_their_help_is(report, finding):
    assert "about a note" not in write([dataclasses.replace(report, findings=(finding(),))])
    unhelpful = finding("LEG001", "legs", "info", hint="")
    assert "about a note" in write([dataclasses.replace(report, findings=(unhelpful,))])


def test_of_a_thousand_findings_of_a_rule_ten_are_told(report, finding):
    many = dataclasses.replace(report, findings=tuple(finding(line=i) for i in range(1, 1001)))
    text = write([many])
    assert text.count("the mass is") == 10
    assert "and 990 more findings; check-robot --format json has all of them\n" in text
    assert text.endswith("robot.urdf: 1,000 errors\n")


def test_what_was_not_checked_is_told_with_its_reason_once(report):
    text = write([report])
    assert "skipped: SYM001, SYM002: no legs were found\n" in text
    assert "skipped: INR002: ignored: so\n" in text
    assert "warning: INR999: comment at robot.urdf:3: no such rule\n" in text


def test_the_last_line_counts_and_says_what_can_be_fixed(report):
    last = write([report]).splitlines()[-1]
    assert last == "robot.urdf: 1 error, 2 warnings, 1 note (fixable: 1 with --fix)"


def test_nothing_found_is_said(report):
    clean = dataclasses.replace(report, findings=(), skipped=())
    assert write([clean]).endswith("\nrobot.urdf: no problems found\n")


def test_several_files_have_a_sum(report):
    assert write([report, report]).endswith(
        "\n2 files: 2 errors, 4 warnings, 2 notes (fixable: 2 with --fix)\n"
    )


def test_what_was_fixed_and_what_was_not(repaired):
    text = write([repaired])
    assert "fixed\n  robot.urdf:12: XML003, calf: name it\n" in text
    assert "not fixed: JNT009 calf: no space\n" in text


def test_nothing_of_a_name_reaches_the_terminal_that_it_would_act_on(nasty):
    text = write([nasty])
    for line in text.splitlines():
        assert line.isprintable() or not line
    assert "\\x1b[31m" in text
    assert "\\u202e" in text
    text.encode()  # no halves of characters


@pytest.mark.parametrize("width", [60, 80, 100])
def test_lines_are_no_wider_than_asked(report, finding, width):
    long = dataclasses.replace(
        report, findings=(finding(message="word " * 60, hint="other " * 60, file=Path("x" * 40)),)
    )
    for line in lines([long], width):
        assert sum(len(span.text) for span in line) <= width


def test_a_word_that_cannot_be_broken_is_left_whole(report, finding):
    name = "n" * 150
    long = dataclasses.replace(report, findings=(finding(message=f"link {name} is long"),))
    assert name in write([long])


def test_a_message_of_any_length_does_not_flood_the_terminal(report, finding):
    long = dataclasses.replace(report, findings=(finding(message="n" * 10**6),))
    assert len(write([long])) < 5000


def test_the_robot_is_described_above_the_findings(report):
    text = write([report])
    assert text.startswith("robot.urdf\n  robot     r (URDF)\n  size      0 kg, 0 links in 0 rigid")
