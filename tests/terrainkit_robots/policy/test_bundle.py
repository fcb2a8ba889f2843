import tomllib

import pytest
import torch

from terrainkit.errors import ConfigError, ExportError
from terrainkit_robots.checkpoint import read_checkpoint
from terrainkit_robots.policy.bundle import bundle_policy
from terrainkit_robots.policy.load import load_policy
from terrainkit_robots.rl.env import LeggedEnv
from terrainkit_robots.rl.run import create_run, open_run
from terrainkit_robots.rl.runner import LeggedRunner
from terrainkit_robots.rl.tasks import get_task, task_names
from terrainkit_robots.rl.terrain import Plane, load_terrain
from terrainkit_robots.spec.robot import SPEC_FILE
from terrainkit_robots.spec.robot_spec import RobotSpec

BUNDLED = [name for name in task_names() if get_task(name).trained_run.is_dir()]


def test_bundle_policy_acts_as_the_run(trained, tmp_path):
    bundle = bundle_policy(trained, tmp_path / "policies" / "walk")
    files = sorted(path.name for path in bundle.folder.iterdir())
    assert files == ["model_2.pt", "robot.toml", "run.toml", "task.toml"]
    assert bundle.task == trained.task
    assert bundle.robot.spec == trained.robot.spec
    env = LeggedEnv(trained.task, trained.robot, Plane())
    obs = env.get_observations()
    assert torch.equal(load_policy(bundle, env)(obs), load_policy(trained, env)(obs))


def test_bundle_policy_drops_the_training_state(trained, tmp_path):
    bundle = bundle_policy(trained, tmp_path / "bundle")
    assert "optimizer_state_dict" in read_checkpoint(trained.checkpoint)
    assert "optimizer_state_dict" not in read_checkpoint(bundle.checkpoint)
    assert bundle.checkpoint.stat().st_size < trained.checkpoint.stat().st_size / 2


def test_bundle_policy_keeps_the_map_and_no_local_paths(make_run, map_file, tmp_path):
    run = make_run(map_file)
    terrain = load_terrain(run.terrain)
    LeggedRunner(LeggedEnv(run.task, run.robot, terrain), run.folder).learn(1)
    bundle = bundle_policy(open_run(run.folder), tmp_path / "bundle")
    map_file.unlink()
    info = tomllib.loads((bundle.folder / "run.toml").read_text())
    assert (info["robot"], info["terrain"]) == ("quadruped", "map.toml")
    for path in bundle.folder.iterdir():
        assert str(tmp_path).encode() not in path.read_bytes()
    moved = open_run(bundle.folder.rename(tmp_path / "moved"))
    assert (load_terrain(moved.terrain).env_origins == terrain.env_origins).all()


def test_bundle_policy_rejects_local_robots(quadruped, trained, tmp_path):
    run = create_run(tmp_path / "run", trained.task, quadruped.mjcf.parent, "plane")
    (run.folder / "model_2.pt").write_bytes(trained.checkpoint.read_bytes())
    with pytest.raises(ConfigError, match="expected one of biped, quadruped"):
        bundle_policy(open_run(run.folder), tmp_path / "bundle")
    assert not (tmp_path / "bundle").exists()


def test_bundle_policy_requires_a_checkpoint(make_run, tmp_path):
    with pytest.raises(ConfigError, match="got no checkpoint"):
        bundle_policy(make_run(), tmp_path / "bundle")


def test_bundle_policy_overwrites_nothing(trained, tmp_path):
    (tmp_path / "notes.txt").write_text("mine")
    with pytest.raises(ExportError, match="exists"):
        bundle_policy(trained, tmp_path)
    assert [path.name for path in tmp_path.iterdir()] == ["notes.txt"]


def test_bundled_policies_include_the_quadruped():
    assert "quadruped" in BUNDLED


@pytest.mark.parametrize("name", BUNDLED)
def test_bundled_policy_is_small_and_matches_its_robot(name):
    spec = get_task(name)
    assert sum(path.stat().st_size for path in spec.trained_run.iterdir()) < 2e6
    assert len(list(spec.trained_run.glob("*.pt"))) == 1
    torch.load(open_run(name).checkpoint, weights_only=True)
    info = tomllib.loads((spec.trained_run / "run.toml").read_text())
    assert info["robot"] == name
    assert info["terrain"] in ("plane", "map.toml")
    # The gains and the pose of the robot may have changed since.
    trained, robot = (RobotSpec.load(each / SPEC_FILE) for each in (spec.trained_run, spec.folder))
    assert (trained.joint_order, trained.feet) == (robot.joint_order, robot.feet)
