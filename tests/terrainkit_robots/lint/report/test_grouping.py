from pathlib import Path

import pytest

from terrainkit_robots.analysis.facts import Facts
from terrainkit_robots.description import bundled
from terrainkit_robots.description.load import load_robot
from terrainkit_robots.lint.report.grouping import group_findings
from terrainkit_robots.lint.report.json_report import report_json
from terrainkit_robots.lint.report.sarif import uri
from terrainkit_robots.lint.runner import Report

JOINTS = ["FL_hip_joint", "FR_hip_joint", "RL_hip_joint"]


@pytest.fixture
def groups(finding):
    """Return a function that groups findings, given as keyword arguments, on a quadruped."""
    model = Facts(load_robot(bundled.urdf_path("quadruped"))).model

    def make(*changes):
        return group_findings(model, [finding(**each) for each in changes])

    return make


def on(name, message, **changes):
    return {"subject": name, "message": message.format(name), **changes}


def test_equal_messages_are_one_group(groups):
    (group,) = groups(*(on(name, "joint {}: no effort limit") for name in JOINTS))
    assert group.first.subject == "FL_hip_joint"
    assert group.text == "joint FL_hip_joint: no effort limit"
    assert group.also == "also 2 joints: FR_hip_joint, RL_hip_joint"


def test_different_numbers_are_listed(groups):
    messages = ["mass of {}: got -1 kg; expected > 0", "mass of {}: got -2.5e-3 kg; expected > 0"]
    names = ("FL_calf", "FR_calf")
    (group,) = groups(*(on(n, m) for n, m in zip(names, messages, strict=True)))
    assert group.also == "also 1 link: FR_calf (-2.5e-3)"


def test_other_names_are_listed(groups):
    text = "mass of {}: got 1.2 kg; expected the mass of "
    (group,) = groups(on("FL_calf", text + "FR_calf"), on("RL_calf", text + "RR_calf"))
    assert group.also == "also 1 link: RL_calf (RR_calf)"


def test_lists_of_names_are_one_value(groups):
    text = "mesh {} of {}: got 9 faces"
    one = {"subject": "x.stl", "message": text.format("x.stl", "FL_calf")}
    many = {"subject": "y.stl", "message": text.format("y.stl", "FL_calf, FR_calf, ...")}
    (group,) = groups(one, many)
    assert group.also == "also 1 more: y.stl (FL_calf, FR_calf, ...)"


def test_paths_of_the_subject_are_ignored(groups):
    text = "mesh {}: searched at /robots/{}"
    files = ("meshes/a.stl", "meshes/b.stl")
    (group,) = groups(*(on(file, text.replace("{}", file)) for file in files))
    assert group.also == "also 1 more: meshes/b.stl"


@pytest.mark.parametrize(
    "change",
    [
        {"message": "joint FR_hip_joint: no velocity limit"},
        {"hint": "Other."},
        {"severity": "warning"},
        {"certainty": "likely"},
        {"code": "INR003"},
        {"file": Path("other.urdf")},
    ],
)
def test_other_differences_separate_groups(groups, change):
    text = "joint {}: no effort limit"
    first, second = on("FL_hip_joint", text), on("FR_hip_joint", text) | change
    assert [group.also for group in groups(first, second)] == ["", ""]


def test_reports_show_paths_relative_to_the_working_directory(
    model, finding, tmp_path, monkeypatch
):
    inside, outside = tmp_path / "work" / "r.urdf", tmp_path / "r.urdf"
    inside.parent.mkdir()
    monkeypatch.chdir(inside.parent)
    found = (finding(file=inside), finding(file=outside))
    data = report_json(Report(facts=Facts(model(file=str(inside))), findings=found))
    assert data["file"] == "r.urdf"
    assert [each["file"] for each in data["findings"]] == ["r.urdf", str(outside)]
    assert uri(inside) == "r.urdf"
    assert uri(outside) == outside.as_uri()
