import pytest

from terrainkit_robots.analysis.facts import Facts
from terrainkit_robots.description import bundled
from terrainkit_robots.description.load import load_robot
from terrainkit_robots.lint.report.robot_summary import robot_summary
from terrainkit_robots.lint.runner import lint


def summary(path):
    return dict(robot_summary(lint(Facts(load_robot(path)), [])))


def test_summary_of_a_quadruped():
    lines = summary(bundled.urdf_path("quadruped"))
    assert lines["robot"] == "quadruped (URDF)"
    assert lines["size"] == "15.02 kg, 17 links in 13 rigid bodies, 12 joints"
    assert lines["legs"] == "4, 0.448 m long; feet: FL_foot, FR_foot, RL_foot, RR_foot"
    assert list(lines) == ["robot", "size", "legs", "standing", "  roll", "  hip", "  knee"]
    # The calf's 5.2 N m of the 45.43 N m that the motor has behind its lever.
    assert lines["  knee"].startswith("-1.50 rad, holds 5.2 N m (11%")


def test_repeated_roles_are_numbered():
    assert "  roll 2" in summary(bundled.urdf_path("biped"))


def test_summary_without_legs_and_name(tmp_path):
    (tmp_path / "robot.urdf").write_text('<robot><link name="a"/></robot>')
    assert summary(tmp_path / "robot.urdf") == {
        "robot": "unnamed (URDF)",
        "size": "0 kg, 1 link in 1 rigid body, 0 joints",
        "legs": "none detected",
    }


@pytest.mark.parametrize("value", ["1e300", "1e-300", "1e11", "nan", "-1e308"])
@pytest.mark.parametrize("words", ['effort="{}"', 'upper="{}"', 'mass value="{}"', 'xyz="0 0 {}"'])
def test_extreme_numbers_stay_short(tmp_path, words, value):
    text = bundled.urdf_path("quadruped").read_text()
    start = words.partition("{")[0]
    head, _, rest = text.partition(start)
    (tmp_path / "robot.urdf").write_text(f"{head}{start}{value}{rest[rest.index(chr(34)) :]}")
    for line in summary(tmp_path / "robot.urdf").values():
        assert max(map(len, line.split())) < 25


def test_gains_are_shown_if_simulated():
    report = lint(Facts(load_robot(bundled.urdf_path("quadruped"))), [])
    assert report.may_simulate
    told = dict(robot_summary(report))
    assert "kp 60, kd 2: FL_hip_joint" in told["  roll"]
    static = lint(Facts(load_robot(bundled.urdf_path("quadruped"))), [], simulate=False)
    assert "kp" not in dict(robot_summary(static))["  roll"]
