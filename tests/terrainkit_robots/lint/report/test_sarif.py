import copy
import json
from pathlib import Path
from urllib.parse import unquote_to_bytes

import jsonschema
import pytest

from terrainkit_robots.lint.report.sarif import uri, write
from terrainkit_robots.lint.rule import rules

SCHEMA = json.loads((Path(__file__).parent / "sarif-2.1.0.schema.json").read_text())


def document(*reports):
    made = json.loads(write(reports), parse_constant=int)
    jsonschema.validate(made, SCHEMA)
    return made


def test_it_is_valid_with_several_robots_and_with_names_of_all_kinds(report, nasty, repaired):
    document(report, nasty, repaired)


def test_it_is_valid_without_robots():
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
def test_the_schema_refuses_what_the_standard_does(report, spoil):
    spoiled = copy.deepcopy(document(report))
    spoil(spoiled["runs"][0]["results"][0])
    with pytest.raises(jsonschema.ValidationError):
        jsonschema.validate(spoiled, SCHEMA)


def place(result):
    return result["locations"][0]["physicalLocation"]


def test_every_rule_is_there_with_its_help(report):
    (run,) = document(report)["runs"]
    told = run["tool"]["driver"]["rules"]
    assert [rule["id"] for rule in told] == [rule.code for rule in rules()]
    for rule, theirs in zip(rules(), told, strict=True):
        assert rule.how_to_fix in theirs["help"]["text"]
        assert theirs["shortDescription"]["text"] == rule.title


def test_a_result_says_what_where_and_how_bad(report):
    (run,) = document(report)["runs"]
    error = run["results"][0]
    assert run["tool"]["driver"]["rules"][error["ruleIndex"]]["id"] == error["ruleId"] == "INR002"
    assert error["level"] == "error"
    assert error["message"]["text"] == "the mass is -1 kg; wanted above 0\nWeigh it."
    assert place(error) == {
        "artifactLocation": {"uri": "robot.urdf"},
        "region": {"startLine": 12},
    }
    assert error["locations"][0]["logicalLocations"] == [{"name": "calf", "kind": "element"}]
    assert error["properties"]["measured"] == {"mass": -1.0}
    levels = [result["level"] for result in run["results"]]
    assert levels == ["error", "warning", "warning", "note", "error"]


def test_the_whole_file_has_no_region(report):
    assert place(document(report)["runs"][0]["results"][2]) == {
        "artifactLocation": {"uri": "robot.urdf"}
    }


def test_a_fix_is_described(report):
    result = document(report)["runs"][0]["results"][1]
    assert result["properties"]["fix"] == {"safety": "safe", "description": "take the lead off"}


def test_what_a_comment_quiets_is_a_suppressed_result(report):
    last = document(report)["runs"][0]["results"][-1]
    assert last["suppressions"] == [{"kind": "inSource", "justification": "so"}]
    assert place(last)["region"]["startLine"] == 30


def test_what_was_not_checked_is_a_notification(report):
    (invocation,) = document(report)["runs"][0]["invocations"]
    told = invocation["toolExecutionNotifications"]
    assert [n["level"] for n in told] == ["note", "note", "warning"]
    assert told[0]["associatedRule"] == {"id": "SYM001"}
    assert told[0]["message"]["text"] == "SYM001: no legs were found"


def test_the_facts_come_along(report):
    facts = document(report)["runs"][0]["properties"]["facts"]
    assert facts["robot.urdf"]["links"] == 0


@pytest.mark.parametrize(
    "name", ["a.urdf", "b c/ä%20#?.urdf", "x:y.urdf", "/abs/ü.xml", "\udc80.urdf"]
)
def test_a_file_is_a_uri_that_leads_back_to_it(name):
    text = uri(Path(name))
    assert unquote_to_bytes(text.removeprefix("file://")) == bytes(Path(name))
    assert text.startswith("file:///") == Path(name).is_absolute()
