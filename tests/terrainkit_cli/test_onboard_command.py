import os
import subprocess
import sys

import pytest

from terrainkit_cli.main import main
from terrainkit_robots.analysis.cannot_check import CannotCheckError
from terrainkit_robots.description import bundled
from terrainkit_robots.onboarding.frameworks.frameworks import framework_names
from tests.robots import ARM

NO_PICTURES = "--no-pictures"


@pytest.fixture
def here(tmp_path, monkeypatch, capsys):
    """Run `terrainkit onboard` in this process, in an empty folder."""
    monkeypatch.chdir(tmp_path)
    (tmp_path / "arm.urdf").write_text(ARM)

    def run(*words):
        capsys.readouterr()
        code = main(["onboard", *words])
        captured = capsys.readouterr()
        return code, captured.out, captured.err

    return run


def one_line(err):
    assert err.startswith("terrainkit: error: ")
    assert err.count("\n") == 1
    return err


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
    assert f"  cp -r {tmp_path / 'quad'} legged_gym/envs/quad\n" in out
    assert "train.py --task=quad --headless\n" in out
    for file in ("__init__.py", "quad.py", "quad_config.py"):
        assert (tmp_path / "quad" / file).is_file()
    assert 'name = "quad"' in (tmp_path / "quad/robot.toml").read_text()
    assert '<robot name="quad"' in (tmp_path / "quad/robot.urdf").read_text()
    (tmp_path / "quad/quad.py").write_text("# Mine.\n")
    (tmp_path / "quad/__pycache__").mkdir()
    assert here(*words, "--overwrite")[0] == 0
    assert (tmp_path / "quad/quad.py.before").read_text() == "# Mine.\n"
    assert here(*words, "--overwrite")[0] == 0


@pytest.mark.parametrize(
    ("name", "message"),
    [
        ("go2", "'go2', a folder of LeggedGym-Ex; expected another name, such as --name my_go2"),
        ("genesis", "name: got 'genesis', a framework; expected another one"),
        ("My Robot", "name: got 'My Robot'; expected a name such as my_robot"),
    ],
)
def test_onboard_rejects_name(here, tmp_path, name, message):
    before = list(tmp_path.iterdir())
    words = ("quadruped", "--name", name, NO_PICTURES, "--config", "leggedgym_ex,genesis")
    code, _, err = here(*words)
    assert code == 2
    assert message in one_line(err)
    assert list(tmp_path.iterdir()) == before


def test_onboard_skips_unsupported_framework(here, tmp_path):
    words = ("arm.urdf", NO_PICTURES, "--config", "legged_gym,isaaclab")
    code, out, err = here(*words)
    assert code == 0
    assert "skipped   legged_gym: arm has no legs" in out
    assert "warning: arm.urdf: no configuration for legged_gym" in err
    assert here(*words, "--overwrite", "--strict")[0] == 1
    assert (tmp_path / "arm/isaaclab_config.py").exists()


def test_onboard_default_folder_is_robot_name(here, tmp_path):
    assert here("arm.urdf", NO_PICTURES)[0] == 0
    assert (tmp_path / "arm/robot.toml").exists()


def test_onboard_quotes_viewer_path(here):
    _, out, _ = here("arm.urdf", NO_PICTURES, "-o", "my arm")
    assert "--mjcf='my arm/scene.xml'" in out


def test_onboard_lists_blocking_errors(here, tmp_path):
    (tmp_path / "arm.urdf").write_text(ARM.replace('mass value="1"', 'mass value="-1"'))
    code, out, err = here("arm.urdf", NO_PICTURES)
    assert code == 1
    assert "INR002" in out
    assert "nothing was written" in one_line(err)
    assert not (tmp_path / "arm").exists()


def test_onboard_reports_other_errors(here, tmp_path):
    (tmp_path / "arm.urdf").write_text(ARM.replace('lower="-1.5" upper="1.5" ', ""))
    code, _, err = here("arm.urdf", NO_PICTURES)
    assert code == 1
    assert "1 error remains (JNT006)" in one_line(err)
    assert (tmp_path / "arm/report.md").exists()


def test_onboard_warns_of_failed_standing_test(here, tmp_path, monkeypatch):
    def fail(*_arguments, **_options):
        raise CannotCheckError("300 contacts at once")

    monkeypatch.setattr("terrainkit_robots.simulation.standing.stand_test", fail)
    code, _, err = here("quadruped", NO_PICTURES)
    assert code == 0
    assert "warning: quadruped: the robot does not stand: it could not be simulated" in err
    assert (tmp_path / "quadruped/robot.toml").exists()
    assert here("quadruped", NO_PICTURES, "--overwrite", "--strict")[0] == 1


@pytest.mark.parametrize(
    ("change", "code"),
    [
        (('lower="-1.5" upper="1.5"', 'lower="1.5" upper="-1.5"'), "JNT007"),
        (('type="revolute"', 'type="revolut"'), "JNT001"),
    ],
)
def test_onboard_blocks_invalid_joint(here, tmp_path, change, code):
    (tmp_path / "arm.urdf").write_text(ARM.replace(*change))
    assert code in here("arm.urdf", NO_PICTURES)[1]
    assert not (tmp_path / "arm").exists()


def test_onboard_does_not_suggest_force_without_robot(here, tmp_path):
    (tmp_path / "empty.urdf").write_text("")
    code, _, err = here("empty.urdf", NO_PICTURES)
    assert code == 1
    assert "--force" not in err


@pytest.mark.parametrize(
    ("words", "message"),
    [
        ([], "FILE: missing"),
        (["nothing.urdf"], "robot file: got nothing.urdf"),
        (["arm.urdf", "-o", "arm.urdf/where"], "arm.urdf is not a folder"),
        (["arm.urdf", "-o", "arm.urdf"], "is not a folder"),
        (["arm.urdf", "--config", "gym"], "framework: got 'gym'; expected: "),
        (["arm.urdf", "--spec", "arm.urdf"], "arm.urdf: not a TOML file"),
        (["arm.urdf", "--spec", "none.toml"], "cannot read none.toml"),
        (["arm.urdf", "--base", "flying"], "--base"),
    ],
)
def test_onboard_rejects_input(here, tmp_path, words, message):
    before = sorted(tmp_path.iterdir())
    code, _, err = here(*words, *([NO_PICTURES] if words else []))
    assert code == 2
    assert message in one_line(err)
    assert sorted(tmp_path.iterdir()) == before


def test_onboard_rejects_spec_of_other_robot(here, tmp_path):
    assert here("arm.urdf", NO_PICTURES)[0] == 0
    code, _, err = here("quadruped", "--spec", "arm/robot.toml", "-o", "robot", NO_PICTURES)
    assert code == 2
    assert "arm/robot.toml belongs to arm: none of its joints is in quadruped" in one_line(err)
    assert not (tmp_path / "robot").exists()


@pytest.mark.parametrize(
    ("before", "after", "message"),
    [
        ('feet = ["FL_foot"', 'feet = ["nope"', "XRF014"),
        ("spawn_height = 0.3", "spawn_height = -0.3", "LEG008"),
    ],
)
def test_onboard_rejects_invalid_spec(here, tmp_path, before, after, message):
    assert here("quadruped", "-o", "first", NO_PICTURES)[0] == 0
    text = (tmp_path / "first/robot.toml").read_text()
    assert before in text
    (tmp_path / "mine.toml").write_text(text.replace(before, after))
    code, _, err = here("quadruped", "-o", "again", "--spec", "mine.toml", NO_PICTURES)
    assert code == 2
    assert f"mine.toml: {message}: " in one_line(err)


def test_onboard_backs_up_edited_spec(here, tmp_path):
    here("arm.urdf", NO_PICTURES)
    spec = tmp_path / "arm/robot.toml"
    spec.write_text(spec.read_text().replace("# Name of the robot.", "# Mine."))
    code, out, _ = here("arm.urdf", NO_PICTURES, "--overwrite")
    assert code == 0
    assert "robot.toml.before" in out
    assert "# Mine." in (tmp_path / "arm/robot.toml.before").read_text()
    # Without new edits, the backup stays.
    code, out, _ = here("arm.urdf", NO_PICTURES, "--overwrite")
    assert code == 0
    assert "# Mine." in (tmp_path / "arm/robot.toml.before").read_text()
    # A second backup does not replace the first.
    spec.write_text(spec.read_text().replace("# Name of the robot.", "# Yours."))
    code, out, _ = here("arm.urdf", NO_PICTURES, "--overwrite")
    assert "robot.toml.before_2" in out
    assert "# Mine." in (tmp_path / "arm/robot.toml.before").read_text()
    assert "# Yours." in (tmp_path / "arm/robot.toml.before_2").read_text()
    assert here("arm.urdf", NO_PICTURES, "--overwrite")[0] == 0


def test_onboard_backs_up_configuration_and_keeps_foreign_file(here, tmp_path):
    words = ("quadruped", "-o", "robot", NO_PICTURES, "--overwrite", "--config", "mjlab")
    assert here(*words)[0] == 0
    config = tmp_path / "robot/mjlab_config.py"
    config.write_text(config.read_text() + "# Mine.\n")
    code, out, _ = here(*words)
    assert code == 0
    assert "mjlab_config.py.before" in out
    assert "# Mine." in (tmp_path / "robot/mjlab_config.py.before").read_text()
    (tmp_path / "robot/train_config.py").write_text("mine")
    code, _, err = here(*words)
    assert code == 2
    assert "also contains train_config.py, which onboarding did not write" in one_line(err)
    assert (tmp_path / "robot/train_config.py").read_text() == "mine"


def test_onboard_ignores_rule_selection_of_settings(here, tmp_path):
    text = (tmp_path / "arm.urdf").read_text()
    (tmp_path / "arm.urdf").write_text(text.replace('<mass value="1"', '<mass value="-1"', 1))
    (tmp_path / "pyproject.toml").write_text('[tool.terrainkit.check-robot]\nselect = ["NAM"]\n')
    assert here("arm.urdf", NO_PICTURES)[0] == 1
    assert not (tmp_path / "arm").exists()


def test_onboard_help_lists_frameworks(capsys):
    assert main(["onboard", "--help"]) == 0
    output = " ".join(capsys.readouterr().out.split())
    for name in framework_names():
        assert name in output


def test_onboard_without_opengl_skips_pictures(tmp_path):
    """`import mujoco` fails with this value of MUJOCO_GL."""
    command = [sys.executable, "-m", "terrainkit_cli.main", "onboard", "quadruped", "-o", "robot"]
    environment = os.environ | {"MUJOCO_GL": "nonsense"}
    run = subprocess.run(
        command, cwd=tmp_path, env=environment, capture_output=True, text=True, check=False
    )
    assert (run.returncode, run.stderr) == (0, "")
    assert "pictures  none: MuJoCo cannot render here (nonsense: " in run.stdout


INTERRUPTED = """
import os, signal, sys
from terrainkit_cli.main import main
from terrainkit_robots.onboarding import folder, pipeline

signal.signal(signal.SIGINT, signal.default_int_handler)  # background jobs ignore SIGINT
def write_then_interrupt(*arguments):
    folder.write_files(*arguments)
    os.kill(os.getpid(), signal.SIGINT)

pipeline.write_files = write_then_interrupt
sys.exit(main(["onboard", "quadruped", "-o", "robot"]))
"""


def test_onboard_interrupted_leaves_no_files(tmp_path):
    run = subprocess.run(
        [sys.executable, "-c", INTERRUPTED],
        cwd=tmp_path,
        env={**os.environ, "PYTHONPATH": os.pathsep.join(filter(None, sys.path))},
        capture_output=True,
        text=True,
        check=False,
    )
    assert run.returncode == 130, run.stderr
    assert list(tmp_path.iterdir()) == []


def test_onboard_warns_about_legs_that_are_not_counted(here, tmp_path):
    """A quadruped that lies on its side, as files with y up do, is no biped."""
    text = bundled.urdf_path("quadruped").read_text()
    turned = """<link name="root"/><joint name="up" type="fixed"><parent link="root"/>
        <child link="base"/><origin xyz="0 0 0" rpy="-1.5708 0 0"/></joint></robot>"""
    (tmp_path / "side.urdf").write_text(text.replace("</robot>", turned))
    err = here("side.urdf", NO_PICTURES)[2]
    assert "warning: side.urdf: number of legs: got 2 " in err
    assert "expected 4, since FR_calf, RR_calf have the joints and masses of a leg" in err
