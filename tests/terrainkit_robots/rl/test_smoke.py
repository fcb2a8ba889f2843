import shutil
import tracemalloc
from dataclasses import replace

import numpy as np
import pytest
import torch

from terrainkit.errors import ConfigError
from terrainkit_robots.description import bundled
from terrainkit_robots.policy import smoke_test as smoke_test
from terrainkit_robots.policy.smoke_test import (
    Smoke,
    memory,
    observation_shapes,
    possible_states,
    record,
    rewards,
    smoke,
    smoke_of,
    spawn_height,
    stands,
    training,
)
from terrainkit_robots.rl.config import Control, Env, Rewards, Task
from terrainkit_robots.rl.env import LeggedEnv
from terrainkit_robots.rl.rewards import REWARDS
from terrainkit_robots.rl.scene import Robot, lowest_point
from terrainkit_robots.rl.tasks import get_task
from terrainkit_robots.rl.terrain import Plane


def failed(found):
    return {check.name for check in found.checks if not check.passed}


@pytest.fixture
def small(lively):
    return lively(16)


@pytest.fixture
def env(quadruped, small):
    return LeggedEnv(small, quadruped, Plane())


def changed(robot, **values):
    return Robot.from_spec(replace(robot.spec, **values), robot.mjcf.parent)


def test_a_bundled_robot_can_be_trained(biped):
    found = smoke(biped, Task(), Plane())
    assert found.passed, failed(found)
    assert found.robot == "biped"
    names = [check.name for check in found.checks]
    assert names[:5] == [
        "environment initialises",
        "spawn height",
        "observation policy",
        "observation privileged",
        "stands for 1 s with zero action",
    ]
    assert names[-2:] == ["memory is bounded", "trains for 3 iterations"]
    assert {f"reward {name}" for name in ("torques", "collision", "stand_still")} < set(names)
    assert len(set(names)) == len(names)


def test_a_task_of_many_robots_and_mini_batches_is_tried(quadruped, small):
    many = replace(
        small,
        env=replace(small.env, num_envs=4096),
        algorithm=replace(small.algorithm, num_mini_batches=512),
    )
    assert "environment initialises" not in failed(smoke(quadruped, many, Plane()))


def test_on_a_map_feet_start_on_the_ground_and_heights_are_observed(
    quadruped, map_ground, lively, calm
):
    feet = spawn_height(LeggedEnv(calm(), quadruped, map_ground))
    assert feet.passed, feet.measured
    policy, privileged = observation_shapes(LeggedEnv(lively(), quadruped, map_ground))
    assert policy.passed
    assert privileged.passed
    assert policy.measured == "232 numbers"


def test_a_spec_that_does_not_fit_ends_it_with_the_reason(quadruped):
    found = smoke(changed(quadruped, penalized_contacts=("tail",)), Task(), Plane())
    (check,) = found.checks
    assert not found.passed
    assert check.name == "environment initialises"
    assert "'tail'" in check.measured


# Each check can fail, and says why.


@pytest.mark.parametrize(
    ("above", "passed", "said"),
    [
        (0.0, True, "1.0 cm"),
        (0.009, True, "1.9 cm"),
        (0.3, False, "31.0 cm"),
        (-0.0105, True, "0.0 cm"),
        (-0.05, False, "-4.0 cm"),
    ],
)
def test_feet_start_on_the_ground(quadruped, calm, above, passed, said):
    robot = changed(quadruped, spawn_height=quadruped.spec.spawn_height + above)
    check = spawn_height(LeggedEnv(calm(), robot, Plane()))
    assert check.passed is passed
    assert said in check.measured
    assert f"spawn_height {robot.spec.spawn_height:.4g} m" in check.measured


def test_flat_soles_are_measured_at_their_lowest_corner(biped, calm):
    level = spawn_height(LeggedEnv(calm(), biped, Plane()))
    assert level.passed
    pose = biped.spec.per_joint("default_pose")
    pose["left_ankle_pitch_joint"] += 0.2
    tilted = spawn_height(LeggedEnv(calm(), changed(biped, default_pose=pose), Plane()))
    assert not tilted.passed
    assert "-" in tilted.measured.split("(left_ankle")[0]


def test_one_foot_in_the_air_is_told(quadruped, calm):
    pose = quadruped.spec.per_joint("default_pose")
    pose["FL_calf_joint"] -= 0.4
    check = spawn_height(LeggedEnv(calm(), changed(quadruped, default_pose=pose), Plane()))
    assert not check.passed
    assert "(FL_foot)" in check.measured.split(" to ")[1]


def test_feet_without_a_shape_are_told(quadruped, calm):
    robot = changed(quadruped, feet=("FL_foot", "FR_foot", "RL_foot", "base"))
    env = LeggedEnv(calm(), robot, Plane())
    geoms = env.scene.model.body("base")
    first = int(geoms.geomadr[0])
    own = set(range(first, first + int(geoms.geomnum[0])))
    env.scene = replace(env.scene, geoms=np.array([g for g in env.scene.geoms if g not in own]))
    check = spawn_height(env)
    assert not check.passed
    assert check.measured.endswith("no collision shape: base")


def test_the_lowest_point_of_every_shape_is_that_of_mujoco():
    import mujoco

    spec = mujoco.MjSpec()
    kind = mujoco.mjtGeom
    spec.add_mesh(name="wedge", uservert=[0, 0, 0, 1, 0, 0, 0, 1, 0, 0, 0, 1])
    for shape in ("SPHERE", "CAPSULE", "CYLINDER", "ELLIPSOID", "BOX", "MESH"):
        body = spec.worldbody.add_body(pos=[0, 0, 2], quat=[0.6, 0.3, -0.5, 0.55])
        geom = body.add_geom(type=getattr(kind, f"mjGEOM_{shape}"), size=[0.1, 0.2, 0.3])
        if shape == "MESH":
            geom.meshname = "wedge"
    floor = spec.worldbody.add_geom(type=kind.mjGEOM_BOX, size=[9, 9, 0.1], pos=[0, 0, -0.1])
    model = spec.compile()
    data = mujoco.MjData(model)
    mujoco.mj_kinematics(model, data)
    shapes = [g for g in range(model.ngeom) if g != floor.id]
    assert len(shapes) == 6
    for geom in shapes:
        wanted = mujoco.mj_geomDistance(model, data, geom, floor.id, 10, None)
        got = lowest_point(model, data, geom)
        assert got == pytest.approx(wanted, abs=1e-4), model.geom_type[geom]


@pytest.mark.parametrize("group", ["policy", "privileged"])
def test_observations_of_another_width_are_told(env, group):
    assert all(check.passed for check in observation_shapes(env))
    commands, gravity, *others = env.obs_groups[group]
    wide = replace(gravity, read=lambda state: np.tile(gravity.read(state), 2))
    env.obs_groups[group] = (commands, wide, *others)
    env.reset()
    bad = {check.name: check for check in observation_shapes(env) if not check.passed}
    assert set(bad) == {f"observation {group}"}
    more = {"policy": "48 numbers", "privileged": "83 numbers"}[group]
    assert bad[f"observation {group}"].measured == more


def test_observations_that_are_not_finite_are_told(env):
    env.get_observations()["policy"][3, 4] = torch.nan
    (policy, privileged) = observation_shapes(env)
    assert privileged.passed
    assert not policy.passed
    assert policy.measured == "45 numbers, some not finite"


@pytest.mark.parametrize(
    ("stiffness", "said"),
    [(60.0, "% of its height"), (0.1, "fell after 0.")],
)
def test_a_robot_with_weak_gains_falls(quadruped, calm, stiffness, said):
    task = calm(control=Control(stiffness=stiffness, damping=min(stiffness, 2.0)))
    check = stands(LeggedEnv(task, quadruped, Plane()))
    assert check.passed is (stiffness > 10)
    assert said in check.measured


def test_a_robot_that_sinks_without_a_fall_does_not_stand(quadruped, calm):
    robot = changed(quadruped, termination_contacts=())
    check = stands(LeggedEnv(calm(control=Control(stiffness=1.0)), robot, Plane()))
    assert not check.passed
    assert "% of its height" in check.measured


def found_of(env, name):
    return next(check for check in rewards(env) if check.name == f"reward {name}")


def test_each_reward_in_use_is_looked_at_and_left_as_it_was(env):
    before = dict(env.rewards)
    found = rewards(env)
    assert [check.name for check in found] == [f"reward {name}" for name in before]
    assert all(check.passed for check in found)
    assert env.rewards == before
    assert env.velocity_command.held is None


def constant(value):
    return lambda state, *_: np.full(len(state.base_pos), value, np.float32)


@pytest.mark.parametrize(
    ("value", "said", "passed"),
    [
        (0.0, "0, whatever may happen", False),
        (np.nan, "not finite", False),
        (np.inf, "not finite", False),
    ],
)
def test_a_reward_that_tells_nothing_is_told(env, value, said, passed):
    env.rewards["torques"] = (constant(value), -0.1)
    check = found_of(env, "torques")
    assert check.passed == passed
    assert check.measured == said


def test_a_reward_for_what_did_not_happen_is_no_fault(env):
    env.rewards["torques"] = (lambda state, *_: state.base_pos[:, 0] > 10, -0.1)
    check = found_of(env, "torques")
    assert check.passed
    assert check.measured == "0: nothing happened that it is for"


def test_every_reward_can_be_something_for_a_robot_with_all_that_it_needs(quadruped, calm):
    scales = dict.fromkeys(REWARDS, 1.0)
    env = LeggedEnv(calm(rewards=Rewards(**scales)), quadruped, Plane())
    possible = possible_states(env.state, 1)
    for name, function in REWARDS.items():
        assert function(possible, quadruped, env.cfg.rewards).any(), name


def test_a_reward_that_nothing_of_the_robot_can_earn_is_told(quadruped, calm):
    env = LeggedEnv(calm(), changed(quadruped, penalized_contacts=()), Plane())
    check = found_of(env, "collision")
    assert not check.passed
    assert check.measured == "0, whatever may happen"
    assert "rewards.collision 0" in check.wanted


def test_states_that_are_kept_are_told(env):
    kept, step = [], env.step

    def hoarding(actions):
        kept.append((env.state, env.get_observations()))
        return step(actions)

    env.step = hoarding
    check = memory(env)
    assert not check.passed
    assert 0.5 < float(check.measured.split()[3]) < 5
    assert not tracemalloc.is_tracing()


def test_memory_that_others_keep_is_told(env, monkeypatch):
    sizes = iter(range(0, 10**9, 2_000_000))
    monkeypatch.setattr(smoke_test, "_resident", lambda: next(sizes))
    monkeypatch.setattr(smoke_test, "_MEMORY_STEPS", 2)
    check = memory(env)
    assert not check.passed
    assert check.measured.endswith("the process is 2.0 MB larger")


def test_the_size_of_this_process_is_what_is_looked_at():
    before = smoke_test._resident()
    filled = np.ones(16_000_000)  # more than malloc keeps for later
    assert smoke_test._resident() - before > 0.9 * filled.nbytes


def test_a_policy_that_cannot_learn_is_told(env):
    env.rewards["torques"] = (constant(np.nan), -1.0)
    check = training(env)
    assert not check.passed
    assert check.measured == "rewards are not numbers any more: torques"


def test_the_random_numbers_of_the_caller_stay_as_they_are(env):
    torch.manual_seed(5)
    before = torch.get_rng_state()
    first = training(env)
    assert first.passed
    assert torch.equal(torch.get_rng_state(), before)


# A robot by name, folder or file.


@pytest.fixture
def quick(monkeypatch):
    """Look at the feet alone."""

    def look(robot, task, ground):
        small = smoke_test._still(replace(task, env=Env(num_envs=2, num_threads=1)))
        check = spawn_height(LeggedEnv(small, robot, ground))
        return Smoke(robot=robot.spec.name, checks=(check,))

    monkeypatch.setattr(smoke_test, "smoke", look)


@pytest.mark.usefixtures("quick")
def test_a_file_is_onboarded_first_and_stays_as_it_is(tmp_path):
    urdf = tmp_path / "quadruped.urdf"
    shutil.copy(bundled.find("quadruped"), urdf)
    before = urdf.read_bytes()
    found = smoke_of(str(urdf))
    assert found.passed, failed(found)
    assert [check.name for check in found.checks] == ["can be onboarded", "spawn height"]
    assert [path.name for path in tmp_path.iterdir()] == ["quadruped.urdf"]
    assert urdf.read_bytes() == before


@pytest.mark.usefixtures("quick")
def test_a_file_with_errors_is_not_trained(tmp_path):
    text = bundled.find("quadruped").read_text()
    urdf = tmp_path / "bad.urdf"
    urdf.write_text(text.replace('<mass value="', '<mass value="-', 1))
    found = smoke_of(str(urdf))
    assert [check.name for check in found.checks] == ["can be onboarded"]
    assert not found.passed
    assert "INR" in found.checks[0].measured


@pytest.mark.usefixtures("quick")
def test_a_folder_whose_spec_was_edited_badly_fails(tmp_path):
    folder = tmp_path / "mine"
    shutil.copytree(get_task("quadruped").folder, folder)
    spec = folder / "robot.toml"
    text = spec.read_text()
    assert "spawn_height = 0.34626" in text
    spec.write_text(text.replace("spawn_height = 0.34626", "spawn_height = 0.64626"))
    found = smoke_of(str(folder))
    assert failed(found) == {"spawn height"}
    plain = record(found)
    assert plain["verdict"] == "fail"
    assert plain["checks"][0]["measured"].startswith("31.0 cm")


def test_a_name_of_nothing_and_a_spec_of_a_folder_are_errors(tmp_path):
    with pytest.raises(ConfigError, match="there are: biped, quadruped"):
        smoke_of("unicorn")
    with pytest.raises(ConfigError, match="which has one"):
        smoke_of("quadruped", spec=tmp_path / "robot.toml")
