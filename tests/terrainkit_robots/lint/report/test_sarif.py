import copy
import json
from dataclasses import replace
from pathlib import Path
from urllib.parse import unquote_to_bytes

import jsonschema
import pytest

from terrainkit_robots.lint.report.sarif import to_text, uri
from terrainkit_robots.lint.rule import rules
from terrainkit_robots.lint.selection import Suppressed

SCHEMA = json.loads((Path(__file__).parent / "sarif-2.1.0.schema.json").read_text())


def document(*reports):
    made = json.loads(to_text(reports), parse_constant=int)
    jsonschema.validate(made, SCHEMA)
    return made


def test_document_is_valid(report, nasty, fixed_report):
    document(report, nasty, fixed_report)


def test_document_without_robots_is_valid():
    assert document()["runs"][0]["results"] == []


@pytest.mark.parametrize(
    "spoil",
    [
        lambda result: result.update(level="info"),
        lambda result: result.update(hint="no such key"),
        lambda result: result.pop("message"),
        lambda result: result["message"].update(text="a {0}"),
        lambda result: place(result)["region"].update(startLine=0),
        lambda result: place(result)["artifactLocation"].update(uri="a b.urdf"),
    ],
    ids=["level", "unknown key", "no message", "placeholder", "line", "uri"],
)
def test_schema_rejects_invalid_results(report, spoil):
    spoiled = copy.deepcopy(document(report))
    spoil(spoiled["runs"][0]["results"][0])
    with pytest.raises(jsonschema.ValidationError):
        jsonschema.validate(spoiled, SCHEMA)


def place(result):
    return result["locations"][0]["physicalLocation"]


def test_every_rule_has_help(report):
    (run,) = document(report)["runs"]
    listed = run["tool"]["driver"]["rules"]
    assert [rule["id"] for rule in listed] == [rule.code for rule in rules()]
    for rule, theirs in zip(rules(), listed, strict=True):
        assert rule.how_to_fix in theirs["help"]["text"]
        assert theirs["shortDescription"]["text"] == rule.title


def test_result_has_level_message_and_location(report):
    (run,) = document(report)["runs"]
    error = run["results"][0]
    assert run["tool"]["driver"]["rules"][error["ruleIndex"]]["id"] == error["ruleId"] == "INR002"
    assert error["level"] == "error"
    assert error["message"]["text"] == "the mass is -1 kg; expected > 0\nWeigh it."
    assert place(error) == {
        "artifactLocation": {"uri": "robot.urdf"},
        "region": {"startLine": 12},
    }
    assert error["locations"][0]["logicalLocations"] == [{"name": "calf", "kind": "element"}]
    assert error["properties"]["measured"] == {"mass": -1.0}
    levels = [result["level"] for result in run["results"]]
    assert levels == ["error", "warning", "warning", "note", "error"]


def test_finding_without_line_has_no_region(report):
    assert place(document(report)["runs"][0]["results"][2]) == {
        "artifactLocation": {"uri": "robot.urdf"}
    }


def test_fix_is_described(report):
    result = document(report)["runs"][0]["results"][1]
    assert result["properties"]["fix"] == {"safety": "safe", "description": "change the limit"}


def test_suppressed_finding_is_a_suppressed_result(report):
    last = document(report)["runs"][0]["results"][-1]
    assert last["suppressions"] == [{"kind": "inSource", "justification": "so"}]
    assert place(last)["region"]["startLine"] == 30


def test_accepted_finding_is_a_suppressed_result(report, finding):
    accepted = Suppressed(code="INR002", kind="suppressed", reason="1 finding", finding=finding())
    last = document(replace(report, skipped=(accepted,)))["runs"][0]["results"][-1]
    assert last["ruleId"] == "INR002"
    assert last["suppressions"] == [{"kind": "external", "justification": "1 finding"}]


def test_skipped_rule_is_a_notification(report):
    (invocation,) = document(report)["runs"][0]["invocations"]
    listed = invocation["toolExecutionNotifications"]
    assert [n["level"] for n in listed] == ["note", "note", "warning"]
    assert listed[0]["associatedRule"] == {"id": "SYM001"}
    assert listed[0]["message"]["text"] == "SYM001: no legs detected"


def test_facts_are_included(report):
    facts = document(report)["runs"][0]["properties"]["facts"]
    assert facts["robot.urdf"]["links"] == 0


@pytest.mark.parametrize(
    "name", ["a.urdf", "b c/ä%20#?.urdf", "x:y.urdf", "/abs/ü.xml", "\udc80.urdf"]
)
def test_uri_decodes_to_path(name):
    text = uri(Path(name))
    assert unquote_to_bytes(text.removeprefix("file://")) == bytes(Path(name))
    assert text.startswith("file:///") == Path(name).is_absolute()
