import re

from terrainkit_robots.lint.report.markdown import to_text


def rows(text):
    """Return the cells of each row of the table of findings."""
    table = re.findall(r"^\| (?:error|warning|note) \|.*\|$", text, re.MULTILINE)
    return [re.split(r"(?<!\\)\|", row)[1:-1] for row in table]


def test_each_finding_is_a_row(report):
    text = to_text([report])
    assert text.startswith(
        "## robot.urdf\n\n**1 error, 2 warnings, 1 note** (fixable: 1 with --fix)"
    )
    assert [cell.strip() for cell in rows(text)[0]] == [
        "error",
        "INR002 negative-mass",
        "robot.urdf:12",
        "the mass is -1 kg; expected &gt; 0",
        "Weigh it.",
    ]
    assert len(rows(text)) == 4
    assert "\n- not a legged robot: 2 rules do not apply\n" in text


def test_names_are_escaped(nasty):
    text = to_text([nasty])
    (row,) = rows(text)
    assert len(row) == 5
    for wrong in ("<b>", "@me", "\x1b", "\r", "\u202e"):
        assert wrong not in text
    assert re.search(r"(?<!\\)[`*]", text.replace("**1 error**", "")) is None
    text.encode()


def test_fixed_and_unfixed_findings_are_listed(fixed_report):
    text = to_text([fixed_report])
    assert "Fixed:\n\n- XML003: unnamed-robot: the mass is -1 kg; expected &gt; 0\n" in text
    assert "Not fixed:\n\n- JNT009: calf: no space\n" in text


def test_each_robot_is_a_section(report):
    assert to_text([report, report]).count("\n## robot.urdf\n") == 1
