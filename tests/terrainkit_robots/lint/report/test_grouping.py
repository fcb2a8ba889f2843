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


MASS = "mass of {}: got 1.2 kg; expected the mass of "
FACES = "mesh {} of {}: got 9 faces"


@pytest.mark.parametrize(
    ("found", "also"),
    [
        (
            [on(name, "joint {}: no effort limit") for name in JOINTS],
            "2 joints: FR_hip_joint, RL_hip_joint",
        ),
        (
            [on("FL_calf", "mass of {}: got -1 kg"), on("FR_calf", "mass of {}: got -2.5e-3 kg")],
            "1 link: FR_calf (-2.5e-3)",
        ),
        (
            [on("FL_calf", f"{MASS}FR_calf"), on("RL_calf", f"{MASS}RR_calf")],
            "1 link: RL_calf (RR_calf)",
        ),
        (  # a list of names is one value
            [
                {"subject": "x.stl", "message": FACES.format("x.stl", "FL_calf")},
                {"subject": "y.stl", "message": FACES.format("y.stl", "FL_calf, FR_calf, ...")},
            ],
            "1 more: y.stl (FL_calf, FR_calf, ...)",
        ),
        (  # the path of the subject is left out
            [
                {"subject": file, "message": f"mesh {file}: searched at /robots/{file}"}
                for file in ("meshes/a.stl", "meshes/b.stl")
            ],
            "1 more: meshes/b.stl",
        ),
    ],
    ids=["names", "numbers", "other names", "lists", "paths"],
)
def test_repeated_findings_are_one_group(groups, found, also):
    (group,) = groups(*found)
    assert (group.first.subject, group.text) == (found[0]["subject"], found[0]["message"])
    assert group.also == f"also {also}"


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


def test_numbers_above_999_are_listed_as_one_number(groups):
    counts = {"FL_hip_joint": "25,101", "FR_hip_joint": "131,499,984"}
    (group,) = groups(*(on(name, f"faces of {{}}: got {n}") for name, n in counts.items()))
    assert group.text == "faces of FL_hip_joint: got 25,101"
    assert group.also == "also 1 joint: FR_hip_joint (131499984)"
