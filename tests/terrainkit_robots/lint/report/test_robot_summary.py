import pytest

from terrainkit_robots.analysis.facts import Facts
from terrainkit_robots.description import bundled
from terrainkit_robots.description.load import load_robot
from terrainkit_robots.lint.report.robot_summary import robot_summary
from terrainkit_robots.lint.runner import lint
from tests.robots import QUADRUPED


def summary(path, **options):
    return dict(robot_summary(lint(Facts(load_robot(path)), [], **options)))


def test_summary_of_a_quadruped():
    lines = summary(QUADRUPED)
    assert list(lines)[:7] == ["robot", "size", "legs", "standing", "  roll", "  hip", "  knee"]
    loaded = [label.strip() for label in list(lines)[7:]]
    assert loaded == ["loaded by", "MuJoCo", "Isaac Gym", "Isaac Lab", "Genesis", "PyBullet"]
    assert lines["  Isaac Lab"] == "15.02 kg in 17 bodies; joints reordered"
    assert lines["  Genesis  "].startswith(
        "15.02 kg in 13 bodies; feet are part of FL_calf, FR_calf, RL_calf, RR_calf; "
    )
    assert lines["robot"] == "quadruped (URDF)"
    assert lines["size"] == "15.02 kg, 17 links in 13 rigid bodies, 12 joints"
    assert lines["legs"] == "4, 0.448 m long; feet: FL_foot, FR_foot, RL_foot, RR_foot"
    # The calf's 5.2 N m of the 45.43 N m that the motor has behind its lever.
    assert lines["  knee"].startswith("-1.50 rad, holds 5.2 N m (11%")
    assert "kp 60, kd 2: FL_hip_joint" in lines["  roll"]
    assert "kp" not in summary(QUADRUPED, simulate=False)["  roll"]
    assert "  roll 2" in summary(bundled.urdf_path("biped"), simulate=False)


def test_summary_without_legs_and_name(tmp_path):
    (tmp_path / "robot.urdf").write_text('<robot><link name="a"/></robot>')
    assert summary(tmp_path / "robot.urdf") == {
        "robot": "unnamed (URDF)",
        "size": "0 kg, 1 link in 1 rigid body, 0 joints",
        "legs": "none detected; --feet names feet",
    }


@pytest.mark.parametrize("value", ["1e300", "1e-300", "nan", "-1e308"])
@pytest.mark.parametrize("start", ['effort="', 'upper="', 'mass value="', 'xyz="0 0 '])
def test_extreme_numbers_stay_short(tmp_path, start, value):
    head, _, rest = QUADRUPED.read_text().partition(start)
    (tmp_path / "robot.urdf").write_text(f'{head}{start}{value}"{rest.partition(chr(34))[2]}')
    words = " ".join(summary(tmp_path / "robot.urdf", simulate=False).values()).split()
    assert max(map(len, words)) < 25
