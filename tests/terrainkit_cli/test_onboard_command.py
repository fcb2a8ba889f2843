import os
import subprocess
import sys

import pytest

from terrainkit_cli.main import main
from terrainkit_robots.onboarding.frameworks import frameworks

ARM = """<robot name="arm">
  <link name="stand"><inertial><mass value="5"/>
    <inertia ixx="0.05" iyy="0.05" izz="0.05" ixy="0" ixz="0" iyz="0"/></inertial>
    <collision><geometry><box size="0.2 0.2 0.2"/></geometry></collision></link>
  <link name="upper"><inertial><origin xyz="0 0 0.15"/><mass value="1"/>
    <inertia ixx="0.01" iyy="0.01" izz="0.001" ixy="0" ixz="0" iyz="0"/></inertial>
    <collision><origin xyz="0 0 0.16"/><geometry><box size="0.05 0.05 0.3"/></geometry></collision>
  </link>
  <joint name="shoulder" type="revolute"><parent link="stand"/><child link="upper"/>
    <origin xyz="0 0 0.11"/><axis xyz="0 1 0"/>
    <limit lower="-1.5" upper="1.5" effort="30" velocity="3"/></joint>
</robot>"""
NO_PICTURES = "--no-pictures"


@pytest.fixture
def here(tmp_path, monkeypatch, capsys):
    """Run `terrainkit onboard` in this process, in an empty folder."""
    monkeypatch.chdir(tmp_path)
    (tmp_path / "arm.urdf").write_text(ARM)

    def run(*words):
        capsys.readouterr()
        code = main(["onboard", *words])
        said = capsys.readouterr()
        return code, said.out, said.err

    return run


def one_line(err):
    assert err.startswith("terrainkit: error: ")
    assert err.count("\n") == 1
    return err


def test_a_quadruped_stands(here, tmp_path):
    code, out, err = here("quadruped", "-o", "robot", NO_PICTURES, "--config", "mjlab,genesis")
    assert (code, err) == (0, "")
    assert "stands    yes: 5 s with the gains of robot.toml" in out
    assert "python -m mujoco.viewer --mjcf=robot/scene.xml" in out
    assert (tmp_path / "robot/mjlab_config.py").exists()
    assert (tmp_path / "robot/genesis_config.py").exists()


def test_the_folder_is_called_as_the_robot_unless_told(here, tmp_path):
    assert here("arm.urdf", NO_PICTURES)[0] == 0
    assert (tmp_path / "arm/robot.toml").exists()


def test_the_path_can_be_pasted(here):
    _, out, _ = here("arm.urdf", NO_PICTURES, "-o", "my arm")
    assert "--mjcf='my arm/scene.xml'" in out


def test_errors_that_keep_it_out_are_listed(here, tmp_path):
    (tmp_path / "arm.urdf").write_text(ARM.replace('mass value="1"', 'mass value="-1"'))
    code, out, err = here("arm.urdf", NO_PICTURES)
    assert code == 1
    assert "INR002" in out
    assert "nothing was written" in one_line(err)
    assert not (tmp_path / "arm").exists()


def test_errors_that_do_not_are_told(here, tmp_path):
    (tmp_path / "arm.urdf").write_text(ARM.replace('lower="-1.5" upper="1.5" ', ""))
    code, _, err = here("arm.urdf", NO_PICTURES)
    assert code == 1
    assert "1 error left (JNT006)" in one_line(err)
    assert (tmp_path / "arm/report.md").exists()


@pytest.mark.parametrize(
    ("change", "code"),
    [
        (('lower="-1.5" upper="1.5"', 'lower="1.5" upper="-1.5"'), "JNT007"),
        (('type="revolute"', 'type="revolut"'), "JNT001"),
    ],
)
def test_a_joint_that_would_be_another_keeps_it_out(here, tmp_path, change, code):
    (tmp_path / "arm.urdf").write_text(ARM.replace(*change))
    assert code in here("arm.urdf", NO_PICTURES)[1]
    assert not (tmp_path / "arm").exists()


def test_what_is_not_a_robot_is_not_to_be_forced(here, tmp_path):
    (tmp_path / "empty.urdf").write_text("")
    code, _, err = here("empty.urdf", NO_PICTURES)
    assert code == 1
    assert "--force" not in err


@pytest.mark.parametrize(
    ("words", "message"),
    [
        ([], "no FILE to onboard"),
        (["nothing.urdf"], "there is no file nothing.urdf"),
        (["arm.urdf", "-o", "no/where"], "there is no folder no"),
        (["arm.urdf", "-o", "arm.urdf"], "not a folder"),
        (["arm.urdf", "--config", "gym"], "no framework 'gym'; there are: "),
        (["arm.urdf", "--config", "legged_gym"], "no legs"),
        (["arm.urdf", "--spec", "arm.urdf"], "arm.urdf: not a TOML file"),
        (["arm.urdf", "--spec", "none.toml"], "cannot read none.toml"),
        (["arm.urdf", "--base", "flying"], "--base"),
    ],
)
def test_bad_input_is_one_line_and_writes_nothing(here, tmp_path, words, message):
    before = sorted(tmp_path.iterdir())
    code, _, err = here(*words, *([NO_PICTURES] if words else []))
    assert code == 2
    assert message in one_line(err)
    assert sorted(tmp_path.iterdir()) == before


def test_the_spec_of_another_robot_is_refused(here, tmp_path):
    assert here("arm.urdf", NO_PICTURES)[0] == 0
    code, _, err = here("quadruped", "--spec", "arm/robot.toml", "-o", "robot", NO_PICTURES)
    assert code == 2
    assert "arm/robot.toml is of arm: none of its joints is in quadruped" in one_line(err)
    assert not (tmp_path / "robot").exists()


@pytest.mark.parametrize(
    ("before", "after", "message"),
    [
        ('feet = ["FL_foot"', 'feet = ["nope"', "XRF014"),
        ("spawn_height = 0.3", "spawn_height = -0.3", "LEG008"),
    ],
)
def test_a_spec_that_is_wrong_for_the_robot_is_refused(here, tmp_path, before, after, message):
    assert here("quadruped", "-o", "first", NO_PICTURES)[0] == 0
    text = (tmp_path / "first/robot.toml").read_text()
    assert before in text
    (tmp_path / "mine.toml").write_text(text.replace(before, after))
    code, _, err = here("quadruped", "-o", "again", "--spec", "mine.toml", NO_PICTURES)
    assert code == 2
    assert f"mine.toml: {message}: " in one_line(err)


def test_an_edited_spec_is_kept_when_its_folder_is_replaced(here, tmp_path):
    here("arm.urdf", NO_PICTURES)
    spec = tmp_path / "arm/robot.toml"
    spec.write_text(spec.read_text().replace("# Name of the robot.", "# Mine."))
    code, out, _ = here("arm.urdf", NO_PICTURES, "--overwrite")
    assert code == 0
    assert "robot.toml.before" in out
    assert "# Mine." in (tmp_path / "arm/robot.toml.before").read_text()
    # Once more, and there is nothing new to be kept: what was kept stays.
    code, out, _ = here("arm.urdf", NO_PICTURES, "--overwrite")
    assert code == 0
    assert "# Mine." in (tmp_path / "arm/robot.toml.before").read_text()
    # And it stays beside what is kept of another time.
    spec.write_text(spec.read_text().replace("# Name of the robot.", "# Yours."))
    code, out, _ = here("arm.urdf", NO_PICTURES, "--overwrite")
    assert "robot.toml.before_2" in out
    assert "# Mine." in (tmp_path / "arm/robot.toml.before").read_text()
    assert "# Yours." in (tmp_path / "arm/robot.toml.before_2").read_text()
    assert here("arm.urdf", NO_PICTURES, "--overwrite")[0] == 0


def test_an_edited_configuration_is_kept_and_a_file_of_ones_own_is_not_touched(here, tmp_path):
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
    assert "also holds train_config.py, which onboarding did not write" in one_line(err)
    assert (tmp_path / "robot/train_config.py").read_text() == "mine"


def test_settings_that_select_rules_let_no_broken_robot_in(here, tmp_path):
    text = (tmp_path / "arm.urdf").read_text()
    (tmp_path / "arm.urdf").write_text(text.replace('<mass value="1"', '<mass value="-1"', 1))
    (tmp_path / "pyproject.toml").write_text('[tool.terrainkit.check-robot]\nselect = ["NAM"]\n')
    assert here("arm.urdf", NO_PICTURES)[0] == 1
    assert not (tmp_path / "arm").exists()


def test_the_help_names_every_framework(capsys):
    with pytest.raises(SystemExit):
        main(["onboard", "--help"])
    said = " ".join(capsys.readouterr().out.split())
    for name in frameworks.names():
        assert name in said


def test_a_graphics_library_that_is_not_there_only_costs_the_pictures(tmp_path):
    """MuJoCo itself cannot be imported then."""
    command = [sys.executable, "-m", "terrainkit_cli.main", "onboard", "quadruped", "-o", "robot"]
    environment = os.environ | {"MUJOCO_GL": "nonsense"}
    run = subprocess.run(
        command, cwd=tmp_path, env=environment, capture_output=True, text=True, check=False
    )
    assert (run.returncode, run.stderr) == (0, "")
    assert "pictures  none: MuJoCo cannot draw here (nonsense: " in run.stdout


INTERRUPTED = """
import os, signal, sys
from terrainkit_cli.main import main
from terrainkit_robots.onboarding import folder, pipeline

signal.signal(signal.SIGINT, signal.default_int_handler)  # a job in the background ignores it
whole = folder.write_files

def written_then_interrupted(*arguments):
    whole(*arguments)
    os.kill(os.getpid(), signal.SIGINT)

pipeline.write_files = written_then_interrupted
sys.exit(main(["onboard", "quadruped", "-o", "robot"]))
"""


def test_interrupted_it_leaves_nothing(tmp_path):
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
