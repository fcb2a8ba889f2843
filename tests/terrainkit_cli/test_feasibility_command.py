import json
import shutil

import pytest

from terrainkit.map.terrain_map import TerrainMap
from terrainkit_robots.description import bundled
from tests.tables import read_table


@pytest.fixture
def stairs(terrainkit):
    words = ("--terrain", "stairs", "--rows", 3, "--cols", 1, "--border", 0)
    assert terrainkit("generate", "-o", "m.npz", *words).returncode == 0
    return "m.npz"


def test_feasibility_prints_demands_and_writes_report(terrainkit, tmp_path, stairs):
    run = terrainkit("feasibility", stairs, "--robot", "quadruped", "-o", "report")
    assert run.returncode == 1
    parallel = terrainkit("feasibility", stairs, "--robot", "quadruped", "--jobs", 2)
    assert run.stdout.replace("\nwrote report.json and report.png\n", "") == parallel.stdout
    # Steps of 0.05, 0.14 and 0.23 m at a limit of 0.4 x 0.448 m.
    assert "stairs   0.28     0.78  1.28" in run.stdout
    assert "patch (2, 0), stairs: demand 1.28, step_up 0.23 m (limit 0.179 m) at (" in run.stdout
    assert "\nstairs: 2 of 3 patches, up to difficulty 0.50\n" in run.stdout
    assert "m.npz: quadruped cannot cross 1 of 3 patches" in run.stdout
    report = json.loads((tmp_path / "report.json").read_text())
    assert report["limits"]["step_up"] == pytest.approx(0.1792)
    assert [each["passable"] for each in report["patches"]] == [True, True, False]
    assert (tmp_path / "report.png").stat().st_size > 1000


def test_limits_on_the_command_line_replace_the_derived_ones(terrainkit, stairs):
    words = ("--limit", "step_up=0.25", "step_down=0.3")
    run = terrainkit("feasibility", stairs, "--robot", "quadruped", *words)
    assert run.returncode == 0
    assert "quadruped can cross 3 patches" in run.stdout
    assert "step_up          0.25   given" in run.stdout


def test_limits_without_a_robot_describe_one(terrainkit, stairs):
    words = ("--limit", "step_up=0.25", "--limit", "step_down=0.3")
    run = terrainkit("feasibility", stairs, *words)
    assert run.returncode == 0
    assert "the robot of --limit:\n  step_up          0.25   given\n  step_down" in run.stdout
    assert "  gap              0.314  not given; quadruped: 0.7 x leg_length" in run.stdout
    assert "m.npz: the robot of --limit can cross 3 patches" in run.stdout
    assert "the robot of --limit can cross" in terrainkit("check-map", stairs, *words).stdout
    words = ("--terrain", "slope", "--demand", "0.2:0.9", "--limit", "slope=0.5")
    run = terrainkit("generate", "-o", "s.npz", *words, "--rows", 2, "--cols", 1, "--border", 0)
    assert "demand        ranges for the robot of --limit" in run.stdout


@pytest.mark.parametrize(("words", "message"), read_table(__file__, "invalid_input_is_one_line"))
def test_invalid_input_is_one_line(rejected, stairs, words, message):
    assert message in rejected(f"feasibility {stairs} {words}")


@pytest.mark.parametrize(("old", "new", "message"), read_table(__file__, "robot_without_limits"))
def test_robot_without_limits_is_one_line(rejected, tmp_path, stairs, old, new, message):
    source, folder = bundled.urdf_path("quadruped").parent, tmp_path / "robot"
    shutil.copytree(source, folder, ignore=shutil.ignore_patterns("trained", "tasks"))
    text = (folder / "robot.toml").read_text()
    (folder / "robot.toml").write_text(text.replace(old, new))
    assert message in rejected("feasibility", stairs, "--robot", folder)


def test_check_map_with_a_robot(terrainkit, stairs):
    assert terrainkit("check-map", stairs).returncode == 0
    run = terrainkit("check-map", stairs, "--robot", "quadruped")
    assert run.returncode == 1
    assert "patch (2, 0), stairs: demand 1.28, step_up 0.23 m" in run.stdout
    words = ("--robot", "quadruped", "--limit", "step_up=0.25", "step_down=0.3")
    run = terrainkit("check-map", stairs, *words)
    assert run.returncode == 0
    assert "quadruped can cross 3 patches" in run.stdout


def test_generate_with_a_demand_solves_the_ranges(terrainkit):
    words = ("--terrain", "stairs", "--rows", 3, "--cols", 1, "--border", 0, "--jobs", 2)
    demand = ("--robot", "quadruped", "--demand", "0.2:0.9", "--limit", "step_up=0.2")
    run = terrainkit("generate", "-o", "m.npz", *words, *demand)
    assert run.returncode == 0
    assert "stairs   0.19 to 0.90  step_height 0.03875 to 0.1794\n" in run.stdout
    run = terrainkit("feasibility", "m.npz", "--robot", "quadruped", "--limit", "step_up=0.2")
    assert "stairs   0.19     0.55  0.90" in run.stdout


def test_generate_with_a_demand_solves_the_terrains_that_have_a_column(terrainkit, tmp_path):
    words = ("--preset", "stairs", "--rows", "2", "--cols", "2", "--robot", "quadruped")
    run = terrainkit("generate", "-o", "m.npz", *words, "--demand", "0.2:0.9")
    assert run.returncode == 0
    assert run.stderr.count("no column for pyramid_stairs_inverted (preset stairs)") == 1
    assert "pyramid_stairs_inverted" not in run.stdout
    names = TerrainMap.load(tmp_path / "m.npz").terrain_names
    assert names == ("stairs", "pyramid_stairs")


@pytest.mark.parametrize(("words", "message"), read_table(__file__, "invalid_demand_is_one_line"))
def test_invalid_demand_is_one_line(rejected, tmp_path, words, message):
    assert message in rejected(f"generate --terrain flat -o m.npz {words}")
    assert not (tmp_path / "m.npz").exists()
