import copy
import json
from dataclasses import replace
from pathlib import Path
from urllib.parse import unquote_to_bytes

import jsonschema
import pytest

from terrainkit_robots.lint.check import Suppressed
from terrainkit_robots.lint.report.sarif import to_text, uri
from terrainkit_robots.lint.rule import rules

SCHEMA = json.loads((Path(__file__).parent / "sarif-2.1.0.schema.json").read_text())


def run_of(*reports):
    """Return the run of a valid document."""
    made = json.loads(to_text(reports), parse_constant=int)
    jsonschema.validate(made, SCHEMA)
    (run,) = made["runs"]
    return run


def result(code, level, line, *, subject="calf", measured=None, certainty="proven", **more):
    """Return the expected result of a finding."""
    region = {"region": {"startLine": line}} if line else {}
    place = {"physicalLocation": {"artifactLocation": {"uri": "robot.urdf"}} | region}
    if subject:
        place["logicalLocations"] = [{"name": subject, "kind": "element"}]
    fix = more.pop("fix", None)
    return {
        "ruleId": code,
        "ruleIndex": [rule.code for rule in rules()].index(code),
        "level": level,
        "message": {"text": "the mass is -1 kg; expected > 0\nWeigh it."},
        "locations": [place],
        "properties": {"certainty": certainty, "measured": measured or {"mass": -1.0}}
        | ({"fix": fix} if fix else {}),
        **more,
    }


def test_results_of_a_report(report):
    fix = {"safety": "safe", "description": "change the limit"}
    suppressions = [{"kind": "inSource", "justification": "so"}]
    assert run_of(report)["results"] == [
        result("INR002", "error", 12),
        result("JNT007", "warning", 40, certainty="likely", fix=fix),
        result("JNT007", "warning", 0, subject=""),
        result("LEG004", "note", 1, measured={"legs": 4}),
        result("INR002", "error", 30, subject="hatch", suppressions=suppressions),
    ]


def test_accepted_finding_is_a_suppressed_result(report, finding):
    accepted = Suppressed(code="INR002", kind="suppressed", reason="1 finding", finding=finding())
    suppressions = [{"kind": "external", "justification": "1 finding"}]
    (*_, last) = run_of(replace(report, skipped=(accepted,)))["results"]
    assert last == result("INR002", "error", 12, suppressions=suppressions)


def test_skipped_rule_is_a_notification(report):
    (invocation,) = run_of(report)["invocations"]
    listed = invocation["toolExecutionNotifications"]
    assert [(each["level"], each["message"]["text"]) for each in listed] == [
        ("note", "SYM001: no legs detected"),
        ("note", "SYM002: no legs detected"),
        ("warning", "INR999: comment at robot.urdf:3: unknown rule"),
    ]
    codes = [each.get("associatedRule") for each in listed]
    assert codes == [{"id": "SYM001"}, {"id": "SYM002"}, None]


def test_documents_of_other_reports_are_valid(report, nasty, fixed_report):
    run = run_of(report, nasty, fixed_report)
    assert run["properties"]["facts"]["robot.urdf"]["links"] == 0
    assert run_of()["results"] == []


@pytest.mark.parametrize(
    "spoil",
    [
        lambda result: result.update(level="info"),
        lambda result: result.update(hint="no such key"),
        lambda result: result["message"].update(text="a {0}"),
    ],
    ids=["level", "unknown key", "placeholder"],
)
def test_schema_rejects_invalid_results(report, spoil):
    spoiled = copy.deepcopy(json.loads(to_text([report])))
    spoil(spoiled["runs"][0]["results"][0])
    with pytest.raises(jsonschema.ValidationError):
        jsonschema.validate(spoiled, SCHEMA)


def test_every_rule_has_help(report):
    listed = run_of(report)["tool"]["driver"]["rules"]
    for rule, theirs in zip(rules(), listed, strict=True):
        assert (theirs["id"], theirs["shortDescription"]["text"]) == (rule.code, rule.page.title)
        assert rule.page.how_to_fix in theirs["help"]["text"]


@pytest.mark.parametrize("name", ["a.urdf", "b c/ä%20#?.urdf", "x:y.urdf", "/abs/ü.xml", "\udc80"])
def test_uri_decodes_to_path(name):
    text = uri(Path(name))
    assert unquote_to_bytes(text.removeprefix("file://")) == bytes(Path(name))
    assert text.startswith("file:///") == Path(name).is_absolute()
