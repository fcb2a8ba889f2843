import shutil
from dataclasses import replace

import numpy as np
import pytest

from terrainkit.errors import ConfigError
from terrainkit_robots.description import bundled
from terrainkit_robots.lint.rule import rules
from terrainkit_robots.policy.evaluate import eval_task
from terrainkit_robots.rl.config import Control, Env, Rewards, Task
from terrainkit_robots.rl.env import LeggedEnv
from terrainkit_robots.rl.rewards import REWARDS
from terrainkit_robots.rl.tasks import get_task
from terrainkit_robots.rl.terrain import Plane
from terrainkit_robots.smoke_test import checks as module
from terrainkit_robots.smoke_test.short_training import TrainingRecord
from terrainkit_robots.spec.robot_arrays import Robot
from tests.robots import QUADRUPED
from tests.tables import read_table

RECORD = TrainingRecord(
    losses=[{"value": 0.1}],
    noise_std=0.7,
    first_rewards={},
    last_rewards={},
    falls=(0.0, 0.0),
    robot_seconds=100.0,
    error="",
)
TASK = Task(env=Env(num_envs=16, num_threads=1))


def failed(result):
    return {check.name for check in result["checks"] if not check.passed}


def replace_spec(robot, **values):
    return Robot.from_spec(replace(robot.spec, **values), robot.mjcf.parent)


def still_env(robot, **parts):
    return LeggedEnv(eval_task(replace(TASK, **parts), 4), robot, Plane())


def test_bundled_robot_can_be_trained(biped):
    fractions = []
    result = module.run_checks(biped, Task(), 1, fractions.append)
    assert fractions == [1.0]
    assert failed(result) == set()
    assert (result.about["robot"], result["checks"][0].measured) == ("biped", "16 robots")
    names = [check.name for check in result["checks"]]
    expected = [
        "environment initializes",
        "spawn height",
        "stands with zero action",
        "joints follow their targets",
    ]
    assert names[:4] == expected
    assert names[-1] == "trains for 1 iteration"
    # Levels and the hardest level need a map.
    left_out = "TSK010", "TSK013", "TSK014"
    codes = [rule.code for rule in rules("task") if rule.code not in left_out]
    assert [name.split()[0] for name in names[4:-1]] == codes
    untrained = [check.name for check in module.run_checks(biped, Task(), 0)["checks"]]
    assert untrained == names[:-1]


def test_invalid_spec_fails_the_first_check(quadruped):
    result = module.run_checks(replace_spec(quadruped, penalized_contacts=("tail",)), Task(), 1)
    (check,) = result["checks"]
    assert not check.passed
    assert check.name == "environment initializes"
    assert "'tail'" in check.measured


@pytest.mark.parametrize(("offset", "passed", "height"), read_table(__file__, "spawn_height"))
def test_spawn_height_is_that_of_the_feet(quadruped, offset, passed, height):
    robot = replace_spec(quadruped, spawn_height=quadruped.spec.spawn_height + offset)
    check = module.check_spawn_height(still_env(robot))
    assert check.passed is passed
    assert height in check.measured
    assert f"spawn_height {robot.spec.spawn_height:.4g} m" in check.measured


def test_spawn_height_names_feet_without_shapes(quadruped):
    env = still_env(quadruped)
    foot = env.scene.model.body("FL_foot").id
    geoms = env.scene.geoms[env.scene.model.geom_bodyid[env.scene.geoms] != foot]
    env.scene.geoms = geoms
    check = module.check_spawn_height(env)
    assert not check.passed
    assert check.measured.startswith("FL_foot has no shape, FR_foot 1.0 cm, ")


def test_spawn_height_passes_without_feet(quadruped):
    env = still_env(quadruped)
    env.robot = replace(quadruped, spec=replace(quadruped.spec, feet=()))
    assert module.check_spawn_height(env).passed


def test_spawn_height_is_measured_at_the_lowest_corner(biped):
    assert module.check_spawn_height(still_env(biped)).passed
    pose = biped.spec.per_joint("default_pose")
    pose["left_ankle_pitch_joint"] += 0.2
    check = module.check_spawn_height(still_env(replace_spec(biped, default_pose=pose)))
    assert not check.passed
    assert "left_ankle_roll_link -" in check.measured


@pytest.mark.parametrize(("share", "passed"), [(0.51, True), (0.49, False)])
def test_base_stays_above_half_of_its_height(quadruped, share, passed):
    env = still_env(quadruped)
    stands = module.check_stand(env)
    height = float(env.state.base_height.min())
    percent = 100 * height / quadruped.base_height_target
    assert stands.measured == f"base at {height:.3f} m, {percent:.0f} % of its height"
    check = module.check_stand(
        still_env(replace_spec(quadruped, base_height_target=height / share))
    )
    assert (check.passed, f"{100 * share:.0f} % of its height" in check.measured) == (passed, True)


def test_weak_gains_do_not_stand(quadruped):
    check = module.check_stand(still_env(quadruped, control=Control(stiffness=0.1, damping=0.1)))
    assert not check.passed
    assert "fell after 0." in check.measured


@pytest.mark.parametrize(
    ("values", "code"),
    [
        ({"rewards": Rewards(upright=20.0)}, "TSK006 standing-pays"),
        ({"rewards": Rewards(torques=-200.0)}, "TSK008 falling-pays"),
        # 60 N m/rad, and an effort of 23.7 N m
        ({"control": Control(action_scale=0.4)}, "TSK018 action-range"),
    ],
)
def test_findings_of_the_task_fail(quadruped, values, code):
    task = replace(Task(), **values)
    checks = {check.name: check for check in module.check_rules(task, quadruped)}
    assert [name for name, check in checks.items() if not check.passed] == [code]
    assert checks["TSK001 not-finite"].measured == "nothing found"


def test_excessive_penalties_fail_with_their_names(quadruped, monkeypatch):
    monkeypatch.setattr(module, "MIN_TREND_SAMPLES", 1)
    rewards = Rewards(termination=0.0, ang_vel_xy=-100.0, dof_acc=-0.15)
    result = module.run_checks(quadruped, Task(rewards=rewards), 1)
    assert {"penalty ang_vel_xy", "penalty dof_acc"} <= failed(result)
    assert "penalty lin_vel_z" not in failed(result)
    assert [check.name for check in result["checks"]][-2:] == [
        "reward does not drop",
        "falls do not increase",
    ]


def test_falls_may_outweigh_the_rewards():
    rewards = {"progress": 0.25, "termination": -50.0, "torques": -0.51, "dof_acc": -0.49}
    checks = {check.name: check for check in module.check_penalties(rewards)}
    assert {name: check.passed for name, check in checks.items()} == {
        "penalty torques": False,
        "penalty dof_acc": True,
    }
    assert checks["penalty torques"].measured == "-0.510 /s, 204% of the positive rewards"
    assert checks["penalty torques"].expected == "at most 200%"


def test_training_fails_with_the_reason(quadruped, monkeypatch):
    torques = lambda env: np.nan * env.state.base_pos[:, 0]  # noqa: E731
    monkeypatch.setitem(REWARDS, "torques", torques)
    result = module.run_checks(quadruped, Task(), 100_000)
    check = result["checks"][-1]
    assert (check.name, check.passed) == ("trains for 0 iterations", False)
    assert "torques" in check.measured


@pytest.mark.parametrize(
    ("rewards", "falls", "names"),
    [
        (({"a": 1.0, "b": -2.0}, {"a": 1.0, "b": -1.5}), (0.1, 0.1), set()),
        (({"a": 1.0, "b": -2.0}, {"a": 1.0, "b": -2.09}), (0.1, 0.1), set()),  # 0.1 of 1.0
        (({"a": 1.0, "b": -2.0}, {"a": 1.0, "b": -2.11}), (0.1, 0.1), {"reward does not drop"}),
        # 100 and 146 falls: sqrt(246) is 15.7, and three times that 47.1
        (({"a": 1.0}, {"a": 1.0}), (1.0, 1.46), set()),
        (({"a": 1.0}, {"a": 1.0}), (1.0, 1.48), {"falls do not increase"}),
        (({"a": 1.0}, {"a": 1.0}), (0.0, 0.24), set()),
        (({"a": 1.0}, {"a": 1.0}), (0.0, 0.26), {"falls do not increase"}),
    ],
)
def test_trends_compare_quarters(rewards, falls, names):
    first, last = rewards
    record = replace(RECORD, first_rewards=first, last_rewards=last, falls=falls)
    assert {check.name for check in module.check_trends(record) if not check.passed} == names


@pytest.mark.parametrize(
    ("changed", "passed", "measured"),
    [
        ({}, True, "value 0.1, noise std 0.7"),
        ({"losses": [{"value": np.nan}, {"value": 0.1}]}, False, "value 0.1, noise std 0.7"),
        ({"noise_std": np.inf}, False, "value 0.1, noise std inf"),
        ({"losses": [], "error": "diverged"}, False, "diverged"),
    ],
)
def test_training_must_be_finite(changed, passed, measured):
    check = module.check_training(replace(RECORD, **changed))
    assert (check.passed, check.measured) == (passed, measured)


@pytest.fixture
def quick(monkeypatch):
    """Run one check instead of all."""

    def check(robot, *_):
        return module.make_result(robot.spec.name, module.check_spawn_height(still_env(robot)))

    monkeypatch.setattr(module, "run_checks", check)


@pytest.mark.usefixtures("quick")
def test_smoke_test_onboards_a_file(tmp_path):
    urdf = tmp_path / "quadruped.urdf"
    shutil.copy(bundled.urdf_path("quadruped"), urdf)
    before = urdf.read_bytes()
    result = module.smoke_test(str(urdf))
    assert failed(result) == set()
    assert [check.name for check in result["checks"]] == ["can be onboarded", "spawn height"]
    assert [path.name for path in tmp_path.iterdir()] == ["quadruped.urdf"]
    assert urdf.read_bytes() == before


@pytest.mark.usefixtures("quick")
def test_smoke_test_rejects_a_file_with_errors(tmp_path):
    urdf = tmp_path / "bad.urdf"
    text = bundled.urdf_path("quadruped").read_text()
    urdf.write_text(text.replace('<mass value="', '<mass value="-', 1))
    (check,) = module.smoke_test(str(urdf))["checks"]
    assert (check.name, check.passed) == ("can be onboarded", False)
    assert "INR" in check.measured


@pytest.mark.usefixtures("quick")
def test_smoke_test_of_a_folder_uses_its_spec(tmp_path):
    folder = tmp_path / "robot"
    shutil.copytree(get_task("quadruped").folder, folder)
    text = (folder / "robot.toml").read_text()
    edited = text.replace("spawn_height = 0.344", "spawn_height = 0.644")
    assert edited != text
    (folder / "robot.toml").write_text(edited)
    (check,) = module.smoke_test(str(folder))["checks"]
    assert not check.passed
    assert check.measured.startswith("FL_foot 31.0 cm")


@pytest.mark.parametrize("name", ["quadruped", str(QUADRUPED)], ids=["task", "file"])
def test_smoke_test_trains_with_the_samples_and_reports_progress(monkeypatch, name):
    fractions = []

    def run_checks(robot, task, samples, progress):
        progress((task.runner.seed, samples))
        return module.make_result(robot.spec.name)

    monkeypatch.setattr(module, "run_checks", run_checks)
    module.smoke_test(name, samples=7, seed=3, progress=fractions.append)
    assert fractions == [(3, 7)]


def test_smoke_test_rejects_unknown_names():
    with pytest.raises(ConfigError, match="biped, quadruped"):
        module.smoke_test("unicorn")
