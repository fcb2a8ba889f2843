import pytest

from terrainkit_robots.export.actuator import ActuatorConfig


@pytest.mark.parametrize(
    ("stiffness", "damping", "expected"),
    [(0.0, 0.5, True), (0.0, 0.0, False), (20.0, 0.5, False), (20.0, 0.0, False)],
)
def test_damping_alone_controls_velocity(stiffness, damping, expected):
    config = ActuatorConfig(stiffness=stiffness, damping=damping)
    assert config.is_velocity_control is expected
