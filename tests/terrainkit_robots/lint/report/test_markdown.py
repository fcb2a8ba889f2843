import re

from terrainkit_robots.lint.report.markdown import to_text

MASS = "the mass is -1 kg; expected &gt; 0"
TEXT = f"""\
## robot.urdf

**1 error, 2 warnings, 1 note** (fixable: 1 with --fix)

| | |
|---|---|
| robot | r (URDF) |
| size | 0 kg, 0 links in 0 rigid bodies, 0 joints |
| legs | none detected; --feet names feet |

| | rule | location | finding | how to fix |
|---|---|---|---|---|
| error | INR002 negative-mass | robot.urdf:12 | {MASS} | Weigh it. |
| warning | JNT007 degrees | robot.urdf:40 | {MASS} (likely) | Weigh it. |
| warning | JNT007 degrees | robot.urdf | {MASS} | Weigh it. |
| note | LEG004 legs | robot.urdf:1 | {MASS} | Weigh it. |

Likely: the finding depends on a heuristic, such as leg detection.

Not checked or ignored:

- not a legged robot: 2 rules do not apply
- INR999: comment at robot.urdf:3: unknown rule
- INR002: suppressed: so
"""


def test_markdown_of_reports(report):
    assert to_text([report]) == TEXT
    assert to_text([report, report]) == f"{TEXT}\n{TEXT}"


def test_fixed_and_unfixed_findings_are_listed(fixed_report):
    text = to_text([fixed_report])
    assert "Fixed:\n\n- XML003: unnamed-robot: the mass is -1 kg; expected &gt; 0\n" in text
    assert "Not fixed:\n\n- JNT009: calf: no space\n" in text


def test_names_are_escaped(nasty):
    text = to_text([nasty])
    (row,) = re.findall(r"^\| error \|.*\|$", text, re.MULTILINE)
    assert len(re.findall(r"(?<!\\)\|", row)) == 6
    assert not [wrong for wrong in ("<b>", "@me", "\x1b", "\r", "\u202e") if wrong in text]
    assert re.search(r"(?<!\\)[`*]", text.replace("**1 error**", "")) is None
    text.encode()
