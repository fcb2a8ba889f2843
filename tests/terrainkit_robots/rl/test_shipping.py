import tomllib

import pytest
import torch

from terrainkit.errors import ConfigError, ExportError
from terrainkit_robots.policy.actor import policy_of
from terrainkit_robots.policy.bundle import ship
from terrainkit_robots.rl.config import Env, Policy, Runner, Task
from terrainkit_robots.rl.env import LeggedEnv
from terrainkit_robots.rl.run import create_run, open_run, read_checkpoint
from terrainkit_robots.rl.runner import LeggedRunner
from terrainkit_robots.rl.tasks import get_task, task_names
from terrainkit_robots.rl.terrain import Plane, load_terrain

SHIPPING = [name for name in task_names() if get_task(name).shipped.is_dir()]
TASK = Task(
    env=Env(num_envs=2, num_threads=1),
    policy=Policy(actor_hidden_dims=(8,), critic_hidden_dims=(8,)),
    runner=Runner(num_steps_per_env=2),
)


def test_what_is_shipped_acts_as_the_run(trained, tmp_path):
    run = open_run(trained)
    shipped = ship(run, tmp_path / "trained")
    assert sorted(path.name for path in shipped.folder.iterdir()) == [
        "model_2.pt",
        "robot.toml",
        "run.toml",
        "task.toml",
    ]
    assert shipped.task == run.task
    assert shipped.robot.spec == run.robot.spec
    env = LeggedEnv(run.task, run.robot, Plane())
    seen = env.get_observations()
    assert torch.equal(policy_of(shipped, env)(seen), policy_of(run, env)(seen))


def test_what_only_training_needs_stays_behind(trained, tmp_path):
    run = open_run(trained)
    shipped = ship(run, tmp_path / "trained")
    assert "optimizer_state_dict" in read_checkpoint(run.checkpoint)
    assert (
        read_checkpoint(shipped.checkpoint)
        .keys()
        .isdisjoint({"optimizer_state_dict", "processes", "curves"})
    )
    assert shipped.checkpoint.stat().st_size < run.checkpoint.stat().st_size / 2


def test_the_first_policy_of_a_robot_makes_the_folder_of_its_policies(trained, tmp_path):
    assert ship(open_run(trained), tmp_path / "trained" / "walk").checkpoint is not None


def test_a_checkpoint_may_be_asked_for(trained, tmp_path):
    assert ship(open_run(trained, 1), tmp_path / "trained").checkpoint.name == "model_1.pt"


def test_a_map_is_made_again_and_no_folder_of_this_machine_is_named(map_file, tmp_path):
    run = create_run(tmp_path / "run", TASK, "quadruped", map_file)
    ground = load_terrain(run.terrain)
    LeggedRunner(LeggedEnv(TASK, run.robot, ground), run.folder).learn(1)
    shipped = ship(open_run(run.folder), tmp_path / "elsewhere")
    map_file.unlink()
    told = tomllib.loads((shipped.folder / "run.toml").read_text())
    assert (told["robot"], told["terrain"]) == ("quadruped", "map.toml")
    for path in shipped.folder.iterdir():
        assert str(tmp_path).encode() not in path.read_bytes()
    moved = shipped.folder.rename(tmp_path / "moved")
    again = open_run(moved)
    assert again.terrain == str(moved / "map.toml")
    assert (load_terrain(again.terrain).env_origins == ground.env_origins).all()


def test_what_is_found_on_this_machine_alone_is_refused(quadruped, trained, tmp_path):
    ground = tmp_path / "ground.xml"
    ground.write_text("<mujoco><worldbody><geom type='plane' size='5 5 1'/></worldbody></mujoco>")
    run = create_run(tmp_path / "on_xml", TASK, "quadruped", ground)
    (run.folder / "model_2.pt").write_bytes((trained / "model_2.pt").read_bytes())
    with pytest.raises(ConfigError, match=r"ground\.xml, which is no map that can be made again"):
        ship(open_run(run.folder), tmp_path / "trained")
    run = create_run(tmp_path / "of_folder", TASK, quadruped.mjcf.parent, "plane")
    (run.folder / "model_2.pt").write_bytes((trained / "model_2.pt").read_bytes())
    with pytest.raises(ConfigError, match="wanted one that is registered: biped, quadruped"):
        ship(open_run(run.folder), tmp_path / "trained")
    assert not (tmp_path / "trained").exists()


def test_a_run_without_a_policy_is_refused(tmp_path):
    run = create_run(tmp_path / "run", TASK, "quadruped", "plane")
    with pytest.raises(ConfigError, match="has no checkpoint yet"):
        ship(run, tmp_path / "trained")


def test_nothing_is_overwritten(trained, tmp_path):
    (tmp_path / "trained").mkdir()
    (tmp_path / "trained" / "mine.txt").write_text("mine")
    with pytest.raises(ExportError, match="trained exists"):
        ship(open_run(trained), tmp_path / "trained")
    assert [path.name for path in (tmp_path / "trained").iterdir()] == ["mine.txt"]


# The policies that come with the package.


def test_a_quadruped_that_walks_comes_with_the_package():
    assert "quadruped" in SHIPPING


@pytest.mark.parametrize("name", SHIPPING)
def test_a_policy_of_the_package_is_small_and_holds_nothing_that_could_run(name):
    folder = get_task(name).shipped
    assert sum(path.stat().st_size for path in folder.iterdir()) < 2e6
    assert len(list(folder.glob("*.pt"))) == 1
    torch.load(open_run(name).checkpoint, weights_only=True)
    told = tomllib.loads((folder / "run.toml").read_text())
    assert told["robot"] == name
    assert told["terrain"] in ("plane", "map.toml")


@pytest.mark.parametrize("name", SHIPPING)
def test_a_policy_of_the_package_was_trained_with_the_robot_of_the_package(name):
    found = get_task(name)
    assert (found.shipped / "robot.toml").read_bytes() == (found.folder / "robot.toml").read_bytes()
