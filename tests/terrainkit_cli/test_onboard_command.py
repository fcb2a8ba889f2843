import os
import subprocess
import sys

import numpy as np
import pytest

from terrainkit import MapConfig, SubTerrain, generate
from terrainkit_robots.analysis.cannot_check import CannotCheckError
from tests.robots import ARM
from tests.tables import read_table

NO_PICTURES = "--no-pictures"


@pytest.fixture
def here(terrainkit, tmp_path):
    """Run `terrainkit onboard` in a folder with an arm; return exit code, output and errors."""
    (tmp_path / "arm.urdf").write_text(ARM)

    def run(*words):
        done = terrainkit("onboard", *words)
        return done.returncode, done.stdout, done.stderr

    return run


def test_onboard_quadruped(here, tmp_path):
    code, out, err = here("quadruped", "-o", "robot", NO_PICTURES, "--config", "mjlab,genesis")
    assert (code, err) == (0, "")
    assert "standing  yes: 5 s with the gains of robot.toml" in out
    assert "python -m mujoco.viewer --mjcf=robot/scene.xml" in out
    command = "mjlab_config.py Mjlab-Velocity-Flat-Quadruped"
    assert f"python robot/{command}\n" in out
    assert f"\npython {command}  #" in (tmp_path / "robot/report.md").read_text()
    assert f"python {command}" in (tmp_path / "robot/mjlab_config.py").read_text()
    assert (tmp_path / "robot/genesis_config.py").exists()


def test_onboard_name_is_that_of_the_task(here, tmp_path):
    words = ("quadruped", "--name", "quad", NO_PICTURES, "--config", "leggedgym_ex")
    code, out, err = here(*words)
    assert (code, err) == (0, "")
    assert f"  cp -r {tmp_path / 'quad'}/. legged_gym/envs/quad\n" in out
    assert "train.py --task=quad --headless\n" in out
    for file in ("__init__.py", "quad.py", "quad_config.py"):
        assert (tmp_path / "quad" / file).is_file()
    assert 'name = "quad"' in (tmp_path / "quad/robot.toml").read_text()
    assert '<robot name="quad"' in (tmp_path / "quad/robot.urdf").read_text()
    (tmp_path / "quad/quad.py").write_text("# Mine.\n")
    assert here(*words, "--overwrite")[0] == 0
    assert (tmp_path / "quad/quad.py.before").read_text() == "# Mine.\n"


def test_onboard_for_a_map(here, tmp_path, terrain_map):
    terrain_map.save(tmp_path / "map.npz")
    words = ("quadruped", "--name", "quad", NO_PICTURES, "--config", "leggedgym_ex", "--map")
    code, out, err = here(*words, "map.npz")
    assert (code, err) == (0, "")
    assert "quad_config.py, quad.py, __init__.py, terrain.py, terrain.npz\n" in out
    assert '"heightfield" if' in (tmp_path / "quad/quad_config.py").read_text()
    with np.load(tmp_path / "quad/terrain.npz") as arrays:
        assert arrays["env_origins"].shape == (2, 3, 3)
    config = MapConfig(rows=1, cols=1, terrains=(SubTerrain(terrain="crawl"),))
    solid_map = generate(config)
    solid_map.save(tmp_path / "solids.npz")
    code, _, err = here(*words, "solids.npz", "--overwrite")
    assert code == 0
    assert f"solids.npz has {len(solid_map.solids)} solids, which the heightfields of" in err


def test_onboard_skips_unsupported_framework(here, tmp_path):
    words = ("arm.urdf", NO_PICTURES, "--config", "legged_gym,isaaclab")
    code, out, err = here(*words)
    assert code == 0
    assert "skipped   legged_gym: arm has no legs" in out
    assert "warning: arm.urdf: no configuration for legged_gym" in err
    assert here(*words, "--overwrite", "--strict")[0] == 1
    assert (tmp_path / "arm/isaaclab_config.py").exists()


def test_onboard_lists_blocking_errors(here, tmp_path):
    (tmp_path / "arm.urdf").write_text(ARM.replace('mass value="1"', 'mass value="-1"'))
    code, out, err = here("arm.urdf", NO_PICTURES)
    assert code == 1
    assert "INR002" in out
    assert "nothing was written" in err
    assert not (tmp_path / "arm").exists()


def test_onboard_reports_other_errors(here, tmp_path):
    (tmp_path / "arm.urdf").write_text(ARM.replace('lower="-1.5" upper="1.5" ', ""))
    code, _, err = here("arm.urdf", NO_PICTURES)
    assert code == 0
    assert "warning: arm.urdf: 1 error remains (JNT006); see report.md" in err
    assert (tmp_path / "arm/report.md").exists()
    assert here("arm.urdf", NO_PICTURES, "--overwrite", "--strict")[0] == 1


def test_onboard_warns_of_failed_standing_test(here, tmp_path, monkeypatch):
    def fail(*_arguments, **_options):
        raise CannotCheckError("300 contacts at once")

    monkeypatch.setattr("terrainkit_robots.onboarding.verify.stand_test", fail)
    code, _, err = here("quadruped", NO_PICTURES)
    assert code == 0
    assert "warning: quadruped: the robot does not stand: it could not be simulated" in err
    assert (tmp_path / "quadruped/robot.toml").exists()
    assert here("quadruped", NO_PICTURES, "--overwrite", "--strict")[0] == 1


@pytest.mark.parametrize(("words", "message"), read_table(__file__, "onboard_rejects_input"))
def test_onboard_rejects_input(rejected, tmp_path, words, message):
    (tmp_path / "arm.urdf").write_text(ARM)
    before = sorted(tmp_path.iterdir())
    assert message in rejected(f"onboard {words} --no-pictures")
    assert sorted(tmp_path.iterdir()) == before


def test_onboard_rejects_spec_of_other_robot(here, rejected, tmp_path):
    assert here("arm.urdf", NO_PICTURES)[0] == 0
    error = rejected("onboard quadruped --spec arm/robot.toml -o robot --no-pictures")
    assert "arm/robot.toml belongs to arm: none of its joints is in quadruped" in error
    assert not (tmp_path / "robot").exists()


def test_onboard_ignores_rule_selection_of_settings(here, tmp_path):
    text = (tmp_path / "arm.urdf").read_text()
    (tmp_path / "arm.urdf").write_text(text.replace('<mass value="1"', '<mass value="-1"', 1))
    (tmp_path / "pyproject.toml").write_text('[tool.terrainkit.check-robot]\nselect = ["NAM"]\n')
    assert here("arm.urdf", NO_PICTURES)[0] == 1
    assert not (tmp_path / "arm").exists()


def test_onboard_without_opengl_skips_pictures(tmp_path):
    """`import mujoco` fails with this value of MUJOCO_GL."""
    command = [sys.executable, "-m", "terrainkit_cli.main", "onboard", "quadruped", "-o", "robot"]
    environment = os.environ | {"MUJOCO_GL": "nonsense"}
    run = subprocess.run(
        command, cwd=tmp_path, env=environment, capture_output=True, text=True, check=False
    )
    assert (run.returncode, run.stderr) == (0, "")
    assert "pictures  none of the robot: MuJoCo cannot render here (nonsense: " in run.stdout
