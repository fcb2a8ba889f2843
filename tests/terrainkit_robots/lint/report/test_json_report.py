import json

import terrainkit
from terrainkit_robots.lint.report.json_report import write


def test_one_robot_is_one_document_with_the_keys_of_the_contract(report):
    document = json.loads(write([report]))
    assert document["schema_version"] == 1
    assert document["tool"] == {"name": "terrainkit", "version": terrainkit.__version__}
    assert (document["file"], document["kind"], document["verdict"]) == (
        "robot.urdf",
        "urdf",
        "fail",
    )
    assert document["facts"]["total_mass"] == 0
    assert document["findings"][0] == {
        "code": "INR002",
        "name": "negative-mass",
        "severity": "error",
        "certainty": "proven",
        "subject": "calf",
        "message": "the mass is -1 kg; wanted above 0",
        "hint": "Weigh it.",
        "file": "robot.urdf",
        "line": 12,
        "measured": {"mass": -1.0},
        "fix": None,
    }
    assert [f["fix"] for f in document["findings"]] == [None, "safe", None, None]
    assert [s["code"] for s in document["skipped"]] == ["SYM001", "SYM002", "INR002", "INR999"]


def test_several_robots_are_a_line_each(report, nasty):
    lines = write([report, nasty, report]).splitlines()
    assert [json.loads(line)["verdict"] for line in lines] == ["fail"] * 3


def test_no_robot_is_no_text():
    assert write([]) == ""


def test_numbers_that_json_has_not_are_null_and_text_is_whole(nasty):
    text = write([nasty])
    text.encode("ascii")
    document = json.loads(text, parse_constant=int)
    json.dumps(document, ensure_ascii=False).encode()  # no halves of characters
    measured = document["findings"][0]["measured"]
    assert measured["large"] is None
    assert list(measured.values()).count(None) == 2
    assert "\\udc80" in document["findings"][0]["subject"]


def test_what_was_fixed_is_told(repaired):
    document = json.loads(write([repaired]))
    assert [f["code"] for f in document["fixed"]] == ["XML003"]
    assert [(f["code"], f["reason"]) for f in document["unfixed"]] == [("JNT009", "no space")]
