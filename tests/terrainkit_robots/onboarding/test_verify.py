from terrainkit_robots.analysis.cannot_check import CannotCheckError
from terrainkit_robots.onboarding.pipeline import OnboardOptions, onboard
from terrainkit_robots.simulation import standing
from tests.robots import QUADRUPED


def test_robot_that_cannot_be_simulated_is_not_stable(monkeypatch, tmp_path):
    def fail(*_, **__):
        raise CannotCheckError("too many contacts")

    monkeypatch.setattr(standing, "stand_test", fail)
    checks = onboard(
        QUADRUPED, tmp_path / "robot", OnboardOptions(render_images=False)
    ).verification
    assert checks.standing is None
    assert checks.failures == ("it could not be simulated: too many contacts",)
    assert not checks.is_stable
    assert [each.file for each in checks.equivalences] == ["robot.urdf", "robot.xml"]
