import json

import terrainkit
from terrainkit_robots.lint.report.json_report import to_text


def test_one_robot_is_one_document(report):
    document = json.loads(to_text([report]))
    assert document["schema_version"] == 1
    assert document["tool"] == {"name": "terrainkit", "version": terrainkit.__version__}
    about = [document[key] for key in ("file", "kind", "verdict")]
    assert about == ["robot.urdf", "urdf", "fail"]
    assert document["facts"]["total_mass"] == 0
    assert document["findings"][0] == {
        "code": "INR002",
        "name": "negative-mass",
        "severity": "error",
        "certainty": "proven",
        "subject": "calf",
        "message": "the mass is -1 kg; expected > 0",
        "hint": "Weigh it.",
        "file": "robot.urdf",
        "line": 12,
        "measured": {"mass": -1.0},
        "fix": None,
    }
    assert [f["fix"] for f in document["findings"]] == [None, "safe", None, None]
    assert [s["code"] for s in document["skipped"]] == ["SYM001", "SYM002", "INR002", "INR999"]


def test_several_robots_are_json_lines(report, nasty):
    lines = to_text([report, nasty, report]).splitlines()
    assert [json.loads(line)["verdict"] for line in lines] == ["fail"] * 3
    assert to_text([]) == ""


def test_infinite_numbers_are_null(nasty):
    text = to_text([nasty])
    text.encode("ascii")
    document = json.loads(text, parse_constant=int)
    json.dumps(document, ensure_ascii=False).encode()  # no halves of characters
    infinite, large, _ = document["findings"][0]["measured"].values()
    assert infinite is large is None
    assert "\\udc80" in document["findings"][0]["subject"]


def test_fixed_findings_are_listed(fixed_report):
    document = json.loads(to_text([fixed_report]))
    assert [f["code"] for f in document["fixed"]] == ["XML003"]
    assert [(f["code"], f["reason"]) for f in document["unfixed"]] == [("JNT009", "no space")]
