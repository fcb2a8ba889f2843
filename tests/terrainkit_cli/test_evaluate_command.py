import json
import sys
from functools import partial

import pytest

from tests.tables import read_table

pytest.importorskip("torch", reason="the extra `train` is not installed")

from terrainkit import MapConfig, SubTerrain, generate, suites
from terrainkit_cli.evaluate_command import (
    dimension_rows,
    gait_lines,
    result_rows,
    summary_line,
)
from terrainkit_robots.policy.export import export_policy
from terrainkit_robots.policy.metrics import RolloutMetrics
from terrainkit_robots.policy.result_table import ResultTable
from terrainkit_robots.report_card import policy_limits
from terrainkit_robots.report_card.policy_limits import LimitResult
from terrainkit_robots.rl import run as run_module
from terrainkit_robots.rl.run import open_run

QUICK = ("--seconds", "0.04", "--num-envs", "1")


@pytest.fixture
def here(run_beside_walk):
    """Run `terrainkit evaluate` in a folder with a run `walk`."""
    return partial(run_beside_walk, "evaluate")


def test_evaluate_prints_a_table(here):
    code, out, err = here("walk", "--seconds", "2.1", "--num-envs", "2")
    assert (code, err) == (0, "")
    first, followed, gait, swing, loads, *contacts = out.splitlines()[:9]
    head, *rows = out.splitlines()[9:]
    assert first.startswith("quadruped, model_7.pt, on plane: 2 robots, 0 fell; error 0.")
    assert followed.startswith("commands followed: ")
    assert "steps/s" in gait
    assert "FL_foot" in swing
    assert loads.startswith("largest loads (and 95th percentile): torque ")
    assert [line.split()[0] for line in contacts] == ["FL_foot", "FR_foot", "RL_foot", "RR_foot"]
    columns = "forward left yaw fell m/s rad/s followed swing [cm]"
    assert head.split() == columns.split()
    assert len(rows) == 2
    assert all(row.split()[3] == "0" for row in rows)


def test_evaluate_writes_json_to_a_file(here, rejected, tmp_path, monkeypatch):
    words = ("walk", *QUICK, "-o", "result.json", "--diagram", "gait.png")
    code, out, err = here(*words)
    assert (code, err) == (0, "")
    assert out.startswith("quadruped, model_7.pt, on plane: 1 robot")
    assert out.endswith("wrote result.json\nwrote gait.png\n")
    assert (tmp_path / "gait.png").read_bytes().startswith(b"\x89PNG")
    before = (tmp_path / "result.json").read_text()
    assert json.loads(before)["seconds"] == 0.04
    with monkeypatch.context() as patch:
        patch.setattr(run_module, "open_run", None)  # the file is checked before any work
        assert "result.json exists" in rejected("evaluate", *words)
    assert here(*words, "--overwrite")[0] == 0
    assert (tmp_path / "result.json").read_text() == before


def test_evaluate_loads_the_given_checkpoint(here, monkeypatch):
    monkeypatch.setattr(sys.stderr, "isatty", lambda: True)  # the progress is not in the JSON
    for words, checkpoint in (
        ("walk", "model_7.pt"),
        ("walk --checkpoint 3", "model_3.pt"),
        ("walk/model_3.pt", "model_3.pt"),
    ):
        document = json.loads(here(*words.split(), *QUICK, "--format", "json")[1])
        names = document["robot"], document["checkpoint"], document["terrain"]
        assert names == ("quadruped", checkpoint, "plane")
        assert (document["all"]["robots"], len(document["by_command"])) == (1, 1)


@pytest.mark.parametrize(("words", "message"), read_table(__file__, "evaluate_rejects_invalid"))
@pytest.mark.usefixtures("walking")
def test_evaluate_rejects_invalid_input(rejected, words, message):
    assert message in rejected(f"evaluate {words}")


def test_exported_policy_is_evaluated(here, rejected, tmp_path, monkeypatch):
    export_policy(open_run(tmp_path / "walk"), tmp_path / "out")
    outside = ("--policy", "out/policy.onnx", "--robot", "quadruped")
    code, out, err = here(*outside, *QUICK)
    assert (code, err) == (0, "")
    assert out.startswith("quadruped, policy.onnx, on plane: 1 robot, 0 fell")
    seen = []
    monkeypatch.setattr(
        policy_limits, "measure_limits", lambda *words: seen.append(words[:2]) or 1 / 0
    )
    with pytest.raises(ZeroDivisionError):
        here(*outside, "--limits")
    ((spec, robot_limits),) = seen
    assert spec.policy_name == "policy.onnx"
    assert robot_limits.step_up == pytest.approx(0.1792)
    (tmp_path / "text.onnx").write_text("text")
    given = "--policy out/policy.onnx --robot"
    for words, message in (
        ("--policy out/policy.onnx", "--robot: missing; expected the robot of --policy"),
        ("walk --robot quadruped", "--robot: got a value; expected none without --policy"),
        (f"walk {given} quadruped", "RUN, --policy: got both; expected one of them"),
        (f"{given} quadruped --checkpoint 3", "--checkpoint: got a value; expected none with"),
        (f"{given} biped", "policy.json: joints.name, the policy belongs to another robot"),
        (f"{given} hare", "no task or robot folder 'hare'"),
        ("--policy gone.onnx --robot biped", "cannot read gone.onnx: No such file"),
        ("--policy text.onnx --robot biped", "text.onnx is not a policy: not an ONNX file"),
    ):
        assert message in rejected(f"evaluate {words}")


def make_metrics(**values):
    errors = dict.fromkeys(["lin_vel_error", "lin_vel_error_1s", "ang_vel_error"])
    errors["ang_vel_error_1s"] = None
    return RolloutMetrics(**({"robots": 4, "falls": 4, "success": 0.25} | errors | values))


def make_result(metrics, **groups):
    about = {"robot": "hare", "checkpoint": "model_1.pt", "terrain": "hill.npz", "feet": []}
    return ResultTable(about=about | {"collision": "plane", "all": metrics}, tables=groups)


def test_summary_line_shows_missing_errors():
    assert summary_line(make_result(make_metrics())) == (
        "hare, model_1.pt, on hill.npz: 4 robots, 4 fell, 25% success; "
        "error not measured: no robot walked longer than 2 s after a command"
    )
    line = summary_line(make_result(make_metrics(lin_vel_error=0.12345)))
    assert "error 0.123 m/s (- averaged over 1 s)" in line


def test_result_rows_show_success_by_level():
    terrain, both = make_metrics(terrain="flat"), make_metrics(terrain="flat", level=1, success=1)
    levels = [make_metrics(level=0), make_metrics(level=1)]
    groups = {"by_terrain": [terrain], "by_level": levels, "by_terrain_and_level": [both]}
    head, row = result_rows(make_result(make_metrics(), **groups))
    assert head == ("terrain", "robots", "fell", "m/s", "rad/s", "success", "level 0", "1")
    assert row == ("flat", "4", "4", "-", "-", "25%", "-", "100%")


def test_rows_of_a_task_of_the_user_have_its_commands_and_terms():
    terms = {"rew_torques": -0.25, "tilt": 0.125}
    groups = [make_metrics(command=(0.5, 1, 2), terms=terms, falls=0)]
    result = make_result(make_metrics(terms=terms, success=None), by_command=groups)
    result.about["commands"] = {"height": 1, "pose": 2}
    head, row = result_rows(result)
    assert head == ("height", "pose[0]", "pose[1]", "fell", "tilt")
    assert row == ("0.5", "1", "2", "0/4", "0.125")
    assert summary_line(result).endswith("error not measured: no velocities are commanded")
    assert gait_lines(result) == ["means (rewards per second): rew_torques -0.25, tilt 0.125"]


def test_suite_prints_and_writes_a_report_card(here, rejected, tmp_path, monkeypatch):
    slope = SubTerrain(terrain="slope", parameters={"grade": (0.0, 0.1), "landing": 1.4})
    config = MapConfig(rows=2, cols=1, patch_size=(5.0, 4.0), border=2.0, terrains=(slope,))
    monkeypatch.setattr(suites, "generate_suite", lambda _: generate(config))
    words = ("walk", "--suite", "basics-1", "--repetitions", 2, "-o", "card.json")
    code, out, err = here(*words)
    told = "terrainkit: measuring model_7.pt on basics-1: 2 robots on each patch\n"
    assert (code, err) == (0, told)
    lines = out.splitlines()
    assert lines[0].startswith("quadruped, model_7.pt, on basics-1: success ")
    assert lines[1].split() == ["test", "level", "0", "1", "success", "passed", "level"]
    assert lines[2].startswith("slope  ")
    assert (
        "The table counts the robots, of 2 on each patch, that crossed. A robot crosses a patch if"
        in out
    )
    assert lines[-1] == "wrote card.json, card.md, card.png"
    document = json.loads((tmp_path / "card.json").read_text())
    assert document["repetitions"] == 2
    assert (tmp_path / "card.md").read_text().startswith("# quadruped on basics-1\n")
    assert (tmp_path / "card.png").read_bytes().startswith(b"\x89PNG")
    assert "card.json exists" in rejected("evaluate", *words)


def test_margins_are_printed_and_written(here, tmp_path):
    words = ("walk", "--margins", "--seconds", "0.04", "--repetitions", 1, "-o", "margins.json")
    code, out, err = here(*words)
    assert code == 0
    assert err.startswith("terrainkit: measuring margins: 0.04 s, with ")
    about, head, nominal, latency = out.splitlines()[:4]
    assert about == "margins of quadruped, model_7.pt"
    assert head.split()[:5] == ["condition", "fell", "of", "7", "m/s"]
    assert nominal.split()[:2] == ["nominal", "0"]
    assert latency.split()[:4] == ["latency", "10", "ms", "0"]
    assert out.splitlines()[-1] == "wrote margins.json"
    document = json.loads((tmp_path / "margins.json").read_text())
    assert (document["schema_version"], document["seconds"]) == (1, 0.04)
    first = document["margins"][1]
    assert (first["condition"], first["unit"], first["value"]) == ("latency", "ms", 10)


def test_dimension_rows_count_successes_by_direction():
    key = {"terrain": "gap", "parameter": "width", "value": 0.1, "robots": 4}
    groups = [
        make_metrics(**key, direction="forward", success=0.75, falls=1),
        make_metrics(**key, direction="backward", success=1.0, falls=0),
    ]
    rows = dimension_rows(make_result(make_metrics(), by_terrain_dimension=groups))
    assert rows == [
        ("\nterrain", "dimension", "forward", "backward"),
        ("gap", "width 10.0 cm", "3 of 4, 1 fell", "4 of 4"),
    ]
    assert dimension_rows(make_result(make_metrics())) == []


def test_suite_may_be_a_map(here, rejected, tmp_path):
    flat = SubTerrain(terrain="flat")
    terrain_map = generate(MapConfig(rows=1, cols=1, patch_size=(4.0, 3.0), terrains=(flat,)))
    terrain_map.save(tmp_path / "yard.npz")
    code, out, _ = here("walk", "--suite", "yard.npz", "--repetitions", 1, "-o", "card")
    assert code == 0
    assert out.splitlines()[0].startswith("quadruped, model_7.pt, on yard.npz: success ")
    document = json.loads((tmp_path / "card.json").read_text())
    assert document["sha256"] == suites.suite_hash(terrain_map)
    assert "no file missing.npz" in rejected("evaluate walk --suite missing.npz")


def test_limits_are_printed_and_written(here, tmp_path, monkeypatch):
    def measure(_run, robot_limits, repetitions, *_):
        assert repetitions == 10
        assert robot_limits.step_up == pytest.approx(0.1792)
        result = LimitResult(
            test="stairs",
            unit="m",
            tested=(0.02, 0.36),
            at_90=(0.1, 0.02, 0.11),
            at_50=(0.13, 0.12, 0.14),
            counts=((0.1, 9, 10), (0.14, 3, 20)),
            robot_limit=0.1792,
        )
        about = {"robot": "hare", "checkpoint": "hare.onnx", "leg_length": 0.5}
        return ResultTable(about=about, tables={"limits": (result,)})

    monkeypatch.setattr(policy_limits, "measure_limits", measure)
    code, out, err = here("walk", "--limits", "-o", "limits.json")
    told = "terrainkit: measuring the limits of model_7.pt: 10 robots in each round\n"
    assert (code, err) == (0, told)
    assert out.splitlines() == [
        "test    90 % cross               50 % cross              in legs     crossed"
        "                     limit of the robot",
        "stairs  10.0 cm (< 2.0 to 11.0)  13.0 cm (12.0 to 14.0)  0.20, 0.26"
        "  9/10 at 10.0, 3/20 at 14.0  17.9 cm",
        "",
        "wrote limits.json",
    ]
    document = json.loads((tmp_path / "limits.json").read_text())
    assert document["limits"][0]["at_90"] == [0.1, 0.02, 0.11]
