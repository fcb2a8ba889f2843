"""Test that a robot is simulated with the settings of its file."""

from pathlib import Path

import pytest

import terrainkit_robots
from terrainkit_robots.analysis.cannot_check import CannotCheckError
from terrainkit_robots.analysis.facts import Facts
from terrainkit_robots.description.load import load_robot
from terrainkit_robots.simulation.written_model import (
    make_written_model,
    position_servos,
    stand_as_written,
    written_stand,
)

QUADRUPED = Path(terrainkit_robots.__file__).parent / "description/bundled/quadruped/quadruped.xml"
BASE = '<body name="base" pos="0 0 0.287"'
MASS, BASE_MASS = 15.017, 6.921
FLOOR = '<geom type="plane" size="0 0 1" pos="0 0 1"/>'


@pytest.fixture
def facts(tmp_path):
    """Return the facts of the bundled quadruped with replaced text."""

    def make(*replacements):
        text = QUADRUPED.read_text(encoding="utf-8")
        for old, new in replacements:
            assert old in text
            text = text.replace(old, new)
        path = tmp_path / "robot.xml"
        path.write_text(text, encoding="utf-8")
        return Facts(load_robot(path))

    return make


def test_ground_carries_the_weight(facts):
    robot = facts()
    stand = written_stand(robot)
    assert make_written_model(robot).weight == pytest.approx(MASS * 9.81, rel=1e-4)
    assert stand.lost_weight == pytest.approx(0, abs=0.01)
    assert stand.clearance == 0
    assert 0 < stand.depth < 0.003
    assert stand.speed < 0.1


def test_compensated_gravity_is_missing_on_the_ground(facts):
    robot = facts((BASE, f'{BASE} gravcomp="1"'))
    assert written_stand(robot).lost_weight == pytest.approx(BASE_MASS / MASS, abs=0.01)
    without = stand_as_written(make_written_model(robot), {"body_gravcomp": 0})
    assert without.lost_weight == pytest.approx(0, abs=0.01)
    assert make_written_model(robot).model.body_gravcomp.max() == 1  # a copy was changed


def test_robot_stands_on_the_floor_of_its_scene(facts):
    robot = facts(("<worldbody>", f"<worldbody>{FLOOR}"))
    written = make_written_model(robot)
    assert written.model.geom_pos[written.floor].tolist() == [0, 0, 1]
    assert written_stand(robot).lost_weight == pytest.approx(0, abs=0.01)


def test_missing_mesh_that_is_only_drawn_does_not_matter(facts):
    robot = facts(
        ("<asset>", '<asset><mesh name="m" file="missing.stl"/>'),
        ('<site name="imu"/>', '<site name="imu"/><geom class="visual" type="mesh" mesh="m"/>'),
    )
    assert make_written_model(robot).model.nmesh == 0


def test_position_actuators_act_as_written(facts):
    robot = facts(
        ("<motor name=", "<position name="),
        ('<motor ctrlrange="-23.7 23.7"/>', '<position kp="1"/>'),
        ('<motor ctrlrange="-45.43 45.43"/>', '<position kp="1"/>'),
    )
    written = make_written_model(robot)
    assert written.gains == {}
    assert position_servos(written.model) == list(range(12))
    assert written_stand(robot).height_loss > 0.1


@pytest.mark.parametrize(
    ("replacement", "reason"),
    [
        (("<worldbody>", '<worldbody><geom size="1"/>'), "not flat"),
        (('<body name="FL_foot" pos="0 0 -0.213">', '<body name="FL_foot"><joint/>'), "no name"),
        (('<site name="imu"/>', '<geom mesh="none" type="mesh"/>'), "SIM004"),
    ],
)
def test_what_cannot_be_simulated_has_a_reason(facts, replacement, reason):
    with pytest.raises(CannotCheckError, match=reason):
        make_written_model(facts(replacement))
