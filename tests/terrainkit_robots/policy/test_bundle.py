import tomllib

import pytest
import torch

from terrainkit.errors import ConfigError
from terrainkit_robots.checkpoint import read_checkpoint
from terrainkit_robots.policy.bundle import bundle_policy
from terrainkit_robots.policy.load_policy import load_policy
from terrainkit_robots.rl.env import LeggedEnv
from terrainkit_robots.rl.run import create_run, open_run
from terrainkit_robots.rl.runner import LeggedRunner
from terrainkit_robots.rl.tasks import get_task, task_names
from terrainkit_robots.rl.terrain import Plane, load_terrain
from terrainkit_robots.spec.robot_arrays import SPEC_FILE
from terrainkit_robots.spec.robot_spec import RobotSpec


def test_bundle_policy_acts_as_the_run(trained, tmp_path):
    bundle = bundle_policy(trained, tmp_path / "policies" / "walk")
    files = sorted(path.name for path in bundle.folder.iterdir())
    assert files == ["model_2.pt", "robot.toml", "run.toml", "task.toml"]
    assert (bundle.task, bundle.robot.spec) == (trained.task, trained.robot.spec)
    env = LeggedEnv(trained.task, trained.robot, Plane())
    obs = env.get_observations()
    assert torch.equal(load_policy(bundle, env)(obs), load_policy(trained, env)(obs))
    assert "optimizer_state_dict" in read_checkpoint(trained.checkpoint)
    assert "optimizer_state_dict" not in read_checkpoint(bundle.checkpoint)


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


@pytest.mark.parametrize("name", task_names())
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
