"""Import of configuration classes of legged_gym, with values worked by hand."""

import dataclasses
import math
import tomllib

import pytest

from terrainkit import MapConfig
from terrainkit.errors import ConfigError
from terrainkit.settings.schema import flatten
from terrainkit_robots.rl.config import Task
from terrainkit_robots.rl.import_config import import_config, write_config
from terrainkit_robots.rl.legged_gym_names import CONVERSIONS, names
from terrainkit_robots.rl.tasks import get_task
from terrainkit_robots.spec.robot_arrays import Robot
from tests.tables import read_table

PACKAGE = "legged/envs/base/base_config.py"
CLASS_FILE = "legged/envs/my/my_config.py"


@pytest.fixture
def project(tmp_path):
    """Return a function that writes a project with some class, and imports the class."""

    def run(child, *, robot=None, name=""):
        for file, text in {PACKAGE: read_table(__file__, "base"), CLASS_FILE: child}.items():
            path = tmp_path / file
            path.parent.mkdir(parents=True, exist_ok=True)
            path.write_text(text)
        folder = tmp_path / "out"
        imported = import_config(path, folder, name, robot)
        write_config(imported, folder, overwrite=True)
        files = {file.stem: tomllib.loads(file.read_text()) for file in folder.glob("*.toml")}
        return imported, files

    return run


@pytest.fixture
def quadruped():
    return Robot.load(get_task("quadruped").folder)


def test_every_name_is_a_setting():
    ours = {f"map.{field.name}" for field in dataclasses.fields(MapConfig)}
    ours |= {f"robot.{field.name}" for field in dataclasses.fields(Robot.__annotations__["spec"])}
    ours |= {key for key, _ in flatten(Task())}
    wrong = [key for key, row in names().items() if not row.no and row.here not in ours]
    assert not wrong
    assert {row.how for row in names().values()} == {*CONVERSIONS}


def test_class_with_parents(project):
    imported, files = project(read_table(__file__, "child"))
    assert imported.name == "MyCfg"
    task, robot, terrain = (files[name] for name in ("task", "robot", "map"))
    assert (task["env"]["num_envs"], task["env"]["episode_length_s"]) == (32, 10.0)
    # 2 joints; the parent has other values of these two.
    rewards = task["rewards"]
    assert (rewards["torques"], rewards["dof_acc"]) == (-1e-4, 2 * -2.5e-7)
    assert (rewards["units"], rewards["tracking_lin_vel"], rewards["progress"]) == ("SI", 1.0, 0.0)
    assert task["domain_rand"]["friction"] == "none"
    assert task["domain_rand"]["push_interval_s"] == 15.0
    assert task["domain_rand"]["com_pos_x_range"] == [-0.01, 0.02]
    assert (task["domain_rand"]["com_shift"], rewards["no_fly"]) == (0.0, 0.25)
    assert task["domain_rand"]["added_mass_range"] == "none"
    assert task["domain_rand"]["action_delay"] == [0.0, 2 * 0.005 * 4]
    assert task["termination"]["tilt"] == pytest.approx(math.pi / 3)
    assert task["noise"]["noise_level"] == 0
    assert task["asset"]["self_collisions"] is False
    assert (task["terrain"]["collision"], task["terrain"]["curriculum"]) == ("hfield", "levels")
    assert (task["runner"]["seed"], task["policy"]["init_noise_std"]) == (7, 0.5)
    assert robot["spawn_height"] == pytest.approx(0.1 * math.pi)
    assert robot["default_pose"] == {"hip_joint": 0.1, "knee_joint": -0.5}
    assert robot["stiffness"] == {"hip_joint": 20.0, "knee_joint": 40.0}  # the last part holds
    assert terrain["patch_size"] == [8.0, 6.0]
    shares = {item.get("name", item["terrain"]): item["proportion"] for item in terrain["terrains"]}
    assert shares == {"pyramid_slope_inverted": 0.2, "pyramid_slope": 0.2, "rough_slope": 0.6}
    assert imported.without_effect["domain_rand.friction_range"] == "domain_rand.friction is off"
    assert imported.without_effect["sim.substeps"].startswith("a step has no parts")
    assert imported.listed == read_table(__file__, "listed")


def test_values_that_need_the_robot(project, quadruped, tmp_path):
    imported, files = project(read_table(__file__, "of_quadruped"), robot=quadruped)
    assert not imported.listed
    spec = files["robot"]
    assert spec["feet"] == ["FL_foot", "FR_foot", "RL_foot", "RR_foot"]
    assert spec["termination_contacts"] == ["base"]
    # Joints without a new angle keep theirs.
    assert spec["default_pose"]["FL_hip_joint"] == 0.25
    assert spec["provenance"]["default_pose.FL_hip_joint"]["origin"] == "given"
    knee = quadruped.spec.per_joint("default_pose")["FL_calf_joint"]
    assert spec["default_pose"]["FL_calf_joint"] == knee
    added = files["task"]["domain_rand"]
    assert (added["added_mass"], added["added_mass_range"]) == ("none", [-1.5, 3.0])
    assert added["com_pos_z_range"] == "none"  # it is not randomized
    # A factor of 0 leaves the centers of the limits, which are those of 0.9.
    center = (quadruped.lower[0] + quadruped.upper[0]) / 2
    assert spec["soft_limits"]["FL_hip_joint"] == pytest.approx([center] * 2, abs=1e-3)
    assert (tmp_path / "out" / spec["mjcf"]).samefile(quadruped.mjcf)


def test_class_is_chosen(project):
    two = "class A:\n class env: num_envs = 1\nclass B(A):\n class env: num_envs = 2\n"
    assert project(two, name="B")[1]["task"]["env"]["num_envs"] == 2
    for name, got in {"": "2 classes", "C": "C"}.items():
        with pytest.raises(ConfigError, match=rf"got {got}; expected --class, one of: A, B$"):
            project(two, name=name)


@pytest.mark.parametrize(("text", "message"), read_table(__file__, "rejected"))
def test_file_that_is_no_class(project, text, message):
    with pytest.raises(ConfigError, match=message):
        project(text)


@pytest.mark.parametrize(("text", "listed"), read_table(__file__, "changed"))
def test_changed_values_are_listed(project, text, listed):
    assert project(text)[0].listed == listed


@pytest.mark.parametrize("text", read_table(__file__, "read"))
def test_values_that_are_read(project, text):
    imported, files = project(text)
    assert not imported.listed
    assert files["task"]["env"]["num_envs"] == 8


def test_imports_stay_in_the_project(project, tmp_path):
    (tmp_path / "outside.py").write_text("n = 8\n")
    text = "from outside import n\nclass A:\n class env:\n  num_envs = n\n"
    text += f"from {'.' * 50} import x\nimport {'a' * 300}\nfrom {'a' * 300} import y\n"
    assert project(text)[1]["task"]["env"]["num_envs"] == 8
    (tmp_path / "legged" / ".git").mkdir()
    assert project(text)[0].listed == {"env.num_envs": "not read: line 4: n"}


def test_number_of_inherited_values_is_bounded(project):
    values = "\n".join(f" a{k} = 0" for k in range(9000))
    classes = "\n".join(f"class A{k}(A):\n pass" for k in range(100))
    with pytest.raises(ConfigError, match="got more than 500000 values in all classes"):
        project(f"class A:\n{values}\n{classes}\n")


def test_large_values_are_not_computed(project):
    imported, _ = project("class A:\n class env:\n  num_envs = 9**9**9\n")
    assert imported.listed == {"env.num_envs": "not read: line 3: 9 ** 9 ** 9"}
    imported, _ = project(f"class A:\n class env: num_envs = 0x1{'0' * 4500}")
    assert imported.listed == {"env.num_envs": "not read: line 2: a number of too many digits"}
    # Each list has the one before it twice: 2^40 items.
    lists = "\n  ".join(f"a{k} = [a{k - 1}, a{k - 1}]" for k in range(1, 40))
    with pytest.raises(ConfigError, match="got 10000 values in a class or list"):
        project(f"class A:\n class env:\n  a0 = [1, 2]\n  {lists}\n")
