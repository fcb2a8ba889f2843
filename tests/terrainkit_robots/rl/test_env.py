from dataclasses import replace

import numpy as np
import pytest
import torch
from rsl_rl.env import VecEnv
from tensordict import TensorDict

from terrainkit.errors import ConfigError, PluginError
from terrainkit_robots.rl.config import (
    Commands,
    Control,
    DomainRand,
    Env,
    Noise,
    Observations,
    Rewards,
    Runner,
    Terrain,
)
from terrainkit_robots.rl.env import LeggedEnv
from terrainkit_robots.rl.env_state import env_state, load_env_state
from terrainkit_robots.rl.observations import ObservationTerm
from terrainkit_robots.rl.symmetry import has_symmetry
from terrainkit_robots.rl.terrain import MapGround, Plane
from terrainkit_robots.spec.robot_arrays import Robot
from tests.tables import read_table

SHORT = Env(num_envs=5, num_threads=1, episode_length_s=0.4)


class TestVecEnv:
    """What the runner of rsl-rl relies on."""

    @pytest.fixture(
        params=[
            ("quadruped", False, {}),
            ("quadruped", True, {}),
            ("biped", True, {}),
            ("cart", False, {"commands": Commands(heading_command=True, resampling_time=0.1)}),
            ("quadruped", False, {"control": Control(control_type="T")}),
        ],
        ids=["plane", "map", "biped", "wheel", "torque"],
    )
    def env(self, request, random_env, map_ground):
        robot, on_map, sections = request.param
        robot = request.getfixturevalue(robot)
        return random_env(5, on_map and map_ground, robot, env=SHORT, **sections)

    def test_attributes(self, env):
        assert isinstance(env, VecEnv)
        assert (env.num_envs, env.max_episode_length, env.device) == (5, 20, "cpu")
        assert env.num_actions == len(env.robot.spec.joint_order)
        assert env.episode_length_buf.dtype == torch.long
        assert env.episode_length_buf.tolist() == [0] * 5

    def test_steps_return_finite_tensors_that_never_change(self, env):
        # A view of a live array would change with the next step.
        shapes = {name: (5, width) for name, width in env.obs_sizes.items()}
        kept = list(env.get_observations().values())
        copies = [part.clone() for part in kept]
        for action in acts(env, 12):
            observed, rewards, dones, extras = env.step(action)
            assert isinstance(observed, TensorDict)
            assert observed.batch_size == (5,)
            assert {name: group.shape for name, group in observed.items()} == shapes
            for part in (rewards, *observed.values()):
                assert part.dtype == torch.float32
                assert torch.isfinite(part).all()
            assert rewards.shape == dones.shape == extras["time_outs"].shape == (5,)
            assert dones.dtype == extras["time_outs"].dtype == torch.bool
            for name, group in env.get_observations().items():
                assert torch.equal(group, observed[name]), name
            kept += [*observed.values(), rewards, dones, extras["time_outs"]]
            copies += [part.clone() for part in kept[len(copies) :]]
        for before, after in zip(copies, kept, strict=True):
            assert torch.equal(before, after)

    def test_episodes_end_at_their_length(self, env):
        seen = 0
        for action in acts(env, 23):
            lengths = env.episode_length_buf.clone()
            _, _, dones, extras = env.step(action)
            out, is_last = extras["time_outs"], lengths + 1 >= 20
            # An episode of that length is done, by a time-out or by a fall.
            assert not (out & ~is_last).any()
            assert dones[out | is_last].all()
            expected = torch.where(dones, torch.zeros_like(lengths), lengths + 1)
            assert torch.equal(env.episode_length_buf, expected)
            seen += int(out.sum())
            for name, value in extras.get("log", {}).items():
                assert "/" in name
                assert np.isfinite(value), name
        assert seen > 0

    def test_large_actions_stay_finite_and_unchanged(self, env):
        for sign in (1, -1, 1):
            actions = torch.full((5, env.num_actions), sign * 1e30).requires_grad_()
            observed, rewards, *_ = env.step(actions)
            assert (actions == sign * 1e30).all()
            for part in (rewards, *observed.values()):
                assert torch.isfinite(part).all()
                assert not part.requires_grad


def test_invalid_actions_are_rejected(nominal_env):
    env = nominal_env()
    for strange in (np.nan, np.inf, -np.inf):
        actions = torch.zeros(4, 12)
        actions[2:, 1] = strange
        with pytest.raises(ConfigError, match="actions of environment 2 are not finite"):
            env.step(actions)
    for shape in ((5, 12), (4, 13), (4, 11), (12,)):
        with pytest.raises(ConfigError, match=r"shape of the actions: got \(.*expected \(4, 12"):
            env.step(torch.zeros(shape))
    assert env.episode_length_buf.tolist() == [0] * 4


def stand(env):
    return env.step(torch.zeros(env.num_envs, env.num_actions))


def observed_commands(env):
    """Return the commands that the policy observes, without their scales."""
    return env.get_observations()["policy"][:, :3] / torch.tensor([2, 2, 0.25])


def acts(env, count, seed=0):
    made = torch.Generator().manual_seed(seed)
    return [torch.randn(env.num_envs, env.num_actions, generator=made) for _ in range(count)]


def record(env, actions):
    """Return the bytes of everything that the steps return."""
    found = []
    for each in actions:
        observed, rewards, dones, extras = env.step(each)
        parts = (*observed.values(), rewards, dones, extras["time_outs"])
        found.append([part.numpy().tobytes() for part in parts])
    return found


class TestObservations:
    # The critic also knows the velocity 3, mean velocity 3, friction, mass, center of mass 3,
    # joint offsets 12, push 3 and forces on the feet 12.
    @pytest.mark.parametrize(
        ("on_map", "measured", "width"),
        [(False, None, 0), (True, None, 187), (False, True, 187), (True, False, 0)],
    )
    def test_widths(self, nominal_env, map_ground, on_map, measured, width):
        env = nominal_env(4, on_map and map_ground, terrain=Terrain(measure_heights=measured))
        assert env.obs_sizes == {"policy": 3 * 47 + width, "privileged": 47 + 38 + width}
        assert env.state.height_scan.shape == (4, width)


class TestHistory:
    OPTIONS = Observations(base_lin_vel=True, foot_contact=True, history_length=3)
    WIDTH = 47 + 3 + 4

    @pytest.mark.parametrize("on_map", [False, True])
    def test_previous_observations_follow_the_current_one(self, random_env, map_ground, on_map):
        env = random_env(5, on_map and map_ground, env=SHORT, observations=self.OPTIONS)
        assert env.obs_sizes["policy"] == 3 * self.WIDTH + 187 * on_map
        assert env.obs_sizes["privileged"] == 85 + 4 + 187 * on_map
        seen, length = [env.get_observations()["policy"]], np.ones(5, int)
        for action in acts(env, 30):
            observed, _, dones, _ = env.step(action)
            seen.append(observed["policy"])
            length = np.where(dones, 1, length + 1)
            for k in range(5):
                for step in range(3):
                    part = slice(step * self.WIDTH, (step + 1) * self.WIDTH)
                    # Before its first observation, an episode has copies of it.
                    source = seen[-1 - min(step, length[k] - 1)]
                    assert torch.equal(seen[-1][k, part], source[k, : self.WIDTH])
        assert (length < 30).all()

    def test_history_has_no_terms_after_it(self, nominal_task, quadruped):
        class More(LeggedEnv):
            def observation_terms(self):
                ones = ObservationTerm(lambda env: env.steps_since_reset[:, None] + np.ones((1, 2)))
                groups = super().observation_terms()
                return groups | {"policy": groups["policy"] | {"ones": ones}}

        task = nominal_task(observations=Observations(history_length=3))
        env = More(task, quadruped, Plane())
        seen = [env.get_observations()["policy"]]
        assert seen[0].shape == (4, 3 * 47 + 2)
        for k in range(3):
            seen.append(env.step(torch.zeros(4, 12))[0]["policy"])
            assert torch.equal(seen[-1][:, 47:94], seen[-2][:, :47])
            assert torch.equal(seen[-1][:, 94:141], seen[max(k - 1, 0)][:, :47])
            assert (seen[-1][:, 141:] == k + 2).all()
        half = env.mirror_maps.groups["policy"].index
        assert (half[47:94] - 47).tolist() == half[:47].tolist()

    def test_noise_level_scales_the_noise_of_own_terms(self, nominal_task, quadruped):
        class Noisy(LeggedEnv):
            def observation_terms(self):
                zero = ObservationTerm(lambda env: np.zeros((env.num_envs, 1)), noise=1.0)
                return {name: {"zero": zero} for name in super().observation_terms()}

        for level in (0.0, 0.5):
            env = Noisy(nominal_task(500, noise=Noise(noise_level=level)), quadruped, Plane())
            seen = env.get_observations()
            assert seen["policy"].abs().max() == pytest.approx(level, rel=0.05)
            assert not seen["privileged"].any()

    @pytest.mark.parametrize(
        ("symmetry", "told"),
        [
            ("vectors", "got the symmetry 'vectors'; expected one of: vector, axial,"),
            ("vector", "got 2 numbers; expected 3, as in its symmetry"),
        ],
    )
    def test_wrong_symmetry_of_own_term_is_named(self, nominal_task, quadruped, symmetry, told):
        class Odd(LeggedEnv):
            def observation_terms(self):
                zero = ObservationTerm(lambda env: np.zeros((env.num_envs, 2)), symmetry)
                return {name: {"zero": zero} for name in super().observation_terms()}

        with pytest.raises(PluginError, match=f"^observation zero: {told}"):
            has_symmetry(Odd(nominal_task(), quadruped, Plane()))


class TestActionDelay:
    @pytest.fixture
    def make(self, nominal_env, no_randomization):
        """Return a function that makes environments with an action delay."""

        def make(delay, num_envs=3, **sections):
            delayed = replace(no_randomization, action_delay=delay)
            return nominal_env(num_envs, domain_rand=delayed, **sections)

        return make

    def test_delay_ends_within_a_policy_step(self, make, quadruped):
        # After 2 of 4 simulation steps; the motors are at rest until then.
        env = make((0.01, 0.01), control=Control(control_type="T"))
        env.apply_actions(torch.full((3, 12), 0.1))
        seen = []
        for _ in range(4):
            env.sim.step(1)
            seen.append(env.sim.torque[0, 0] / quadruped.effort[0])
        np.testing.assert_allclose(seen, [0, 0, 0.1, 0.1], atol=1e-6)

    @pytest.mark.parametrize("steps", [1, 3, 7])
    def test_delay_stays_exact_in_long_episodes(self, make, quadruped, steps):
        control = Control(control_type="T", decimation=1)
        env = make((0.005 * steps, 0.005 * steps), 1, control=control)
        applied = []
        for step in range(1500):  # the time accumulates rounding errors
            env.apply_actions(torch.full((1, 12), 1e-4 * step))
            env.sim.step(1)
            applied.append(env.sim.torque[0, 0] / quadruped.effort[0] * 1e4)
        expected = np.maximum(np.arange(1500) - steps, 0)
        np.testing.assert_allclose(applied, expected, rtol=1e-4, atol=1e-3)

    def test_motors_hold_the_default_pose_first(self, nominal_env, make):
        still = nominal_env(3)
        late = make((0.02, 0.02))
        stand(still)
        late.step(torch.ones(3, 12))  # arrives in the next policy step
        np.testing.assert_array_equal(late.sim.qpos, still.sim.qpos)
        late.step(torch.ones(3, 12))
        stand(still)
        assert not np.array_equal(late.sim.qpos, still.sim.qpos)

    def test_delays_are_sampled_at_reset(self, make):
        env = make((0.0, 0.02), 200)
        first = env.sim.batch.expand("actuator_delay").copy()
        assert (first == first[:, :1]).all()  # one delay per robot
        np.testing.assert_allclose(np.unique(first), [0, 0.0025, 0.0075, 0.0125, 0.0175])
        env._reset_idx(np.arange(100))
        second = env.sim.batch.expand("actuator_delay")
        assert (first[:100] != second[:100]).any()
        np.testing.assert_array_equal(first[100:], second[100:])

    def test_no_delay_has_no_buffer(self, nominal_env):
        assert nominal_env().scene.model.nhistory == 0


class TestTermination:
    @pytest.mark.parametrize(
        ("array", "values"),
        [
            ("qpos", {2: 1.3, 3: 0, 4: 1}),  # on its back
            ("qpos", {2: 1.3, 3: np.sqrt(0.5), 4: np.sqrt(0.5)}),  # on its side
            ("qpos", {0: -1.3}),  # outside of the map
            ("qvel", {8: 1e12}),
            ("qpos", {9: np.nan}),
        ],
        ids=["back", "side", "outside", "velocity", "position"],
    )
    def test_fall_resets_only_its_environment(self, nominal_env, mixed_map, array, values):
        env, twin = (nominal_env(4, MapGround(mixed_map)) for _ in "ab")
        for each in (env, twin):
            for _ in range(5):
                stand(each)
        for index, value in values.items():
            getattr(env.sim, array)[2, index] = value
        observed, rewards, dones, extras = stand(env)
        expected, expected_rewards, *_ = stand(twin)
        assert dones.tolist() == [False, False, True, False]
        assert not extras["time_outs"].any()
        assert extras["log"]["Episode/falls"] == 1
        assert env.episode_length_buf.tolist() == [6, 6, 0, 6]
        assert torch.isfinite(rewards).all()
        others = [0, 1, 3]
        for name in ("policy", "privileged"):
            assert torch.isfinite(observed[name]).all()
            assert torch.equal(observed[name][others], expected[name][others])
        assert torch.equal(rewards[others], expected_rewards[others])
        np.testing.assert_array_equal(env.sim.qpos[others], twin.sim.qpos[others])

    def test_unstable_state_gets_only_termination_reward(self, nominal_env):
        # Its state is the state after MuJoCo's reset, which must not be rewarded.
        env = nominal_env(3, rewards=Rewards(termination=-3.0))
        for value in (np.nan, 1e12, np.inf):  # each time
            env.sim.qvel[1, 7] = value
            _, rewards, dones, extras = stand(env)
            assert dones.tolist() == [False, True, False]
            assert rewards[1] == pytest.approx(-3 * 0.02)
            paid = {k: v for k, v in extras["log"].items() if k.startswith("Episode/rew_")}
            assert paid.pop("Episode/rew_termination") == pytest.approx(-3)
            assert set(paid.values()) == {0}
            assert (rewards[[0, 2]] > -0.01).all()


class TestSeeds:
    def test_same_seed_gives_same_rollout(self, random_env, map_ground):
        first, second = (random_env(6, map_ground, runner=Runner(seed=3)) for _ in "ab")
        actions = acts(first, 25)
        expected = record(first, actions)
        assert record(second, actions) == expected
        threaded = random_env(6, map_ground, num_threads=2, runner=Runner(seed=3))
        assert record(threaded, actions) == expected
        other = random_env(6, map_ground, runner=Runner(seed=4))
        assert not np.array_equal(first.params.friction, other.params.friction)


class TestWaypoints:
    COMMANDS = Commands(waypoints=True, lin_vel_x=(0.6, 0.6), standing=0.0)

    @pytest.fixture
    def env(self, nominal_env, course_ground):
        return nominal_env(4, course_ground, commands=self.COMMANDS)

    def move(self, env, robot, x, y):
        env.sim.qpos[robot, :2] = x, y
        *_, done, extras = env.step(torch.zeros(4, 12))
        return done, extras

    def test_commands_lead_to_the_next_goal(self, env):
        assert env.commands[0] == pytest.approx([0.6, 0, 0], abs=1e-6)
        # The second place is 0.28 m from the first goal.
        for place, way, goals in (((1, 1), (3, 1), 0), ((3.8, 1.8), (3.2, 0.2), 1)):
            self.move(env, 0, *place)
            bearing = np.arctan2(way[1], way[0])
            expected = [0.6 * np.cos(bearing), 0, bearing / 2]
            assert env.commands[0] == pytest.approx(expected, abs=0.01)
            assert env.waypoints.index.tolist() == [goals, 0, 0, 0]

    def test_last_goal_ends_the_episode_as_a_success(self, env):
        self.move(env, 0, 4.0, 2.0)
        done, extras = self.move(env, 0, 7.0, 2.0)
        assert done.tolist() == extras["time_outs"].tolist() == [1, 0, 0, 0]
        assert extras["log"]["Episode/goals_reached"] == 1.0
        success = env.curriculum.sampler.statistics.success
        np.testing.assert_array_equal(success[0], [1.0, np.nan])
        assert env.waypoints.index.tolist() == [0, 0, 0, 0]

    @pytest.mark.parametrize(("goals", "progress"), [(0, 0.0), (1, 0.625)])
    def test_progress_is_the_share_of_goals_over_the_promotion(
        self, env, monkeypatch, goals, progress
    ):
        updates = []
        monkeypatch.setattr(env.curriculum.sampler, "update", lambda *args: updates.append(args))
        for _ in range(goals):
            self.move(env, 0, 4.0, 2.0)
        env.sim.qpos[0, 3:7] = 0, 1, 0, 0  # upside down
        self.move(env, 0, 1.0, 2.0)
        robots, made, *_ = updates[-1]
        assert (robots.tolist(), made.tolist()) == ([0], [pytest.approx(progress)])

    def test_terrain_without_goals_is_rejected(self, nominal_env):
        with pytest.raises(ConfigError, match="without goals; expected a map with terrains such"):
            nominal_env(4, commands=self.COMMANDS)

    def test_fixed_commands_have_no_goals(self, env):
        env.set_commands(np.zeros((4, 3), np.float32))
        self.move(env, 0, 4.0, 2.0)
        assert env.waypoints.index[0] == 0
        assert not env.commands.any()


class TestStateDict:
    @pytest.mark.parametrize("ground", [None, "map_ground", "course_ground"])
    @pytest.mark.parametrize("more", [False, True])
    def test_resume_is_bit_identical(self, request, random_env, ground, more):
        # Short commands and episodes, so that everything random is sampled again.
        is_course = ground == "course_ground"
        delay = (0, 0.03) if more else None
        sections = {
            "env": Env(num_envs=6, num_threads=1, episode_length_s=0.7),
            "commands": Commands(resampling_time=0.2, heading_command=True, waypoints=is_course),
            "domain_rand": DomainRand(push_interval_s=0.3, action_delay=delay),
            "observations": TestHistory.OPTIONS if more else Observations(),
        }
        ground = ground and request.getfixturevalue(ground)
        env, other = (random_env(6, ground, **sections) for _ in "ab")
        env.episode_length_buf = torch.arange(6)
        actions = acts(env, 80)
        record(env, actions[:21])
        saved, seen = env_state(env), env.get_observations()
        lengths = env.episode_length_buf.tolist()
        expected = record(env, actions[21:])
        record(other, actions[40:50])  # another past
        load_env_state(other, saved)
        assert other.episode_length_buf.tolist() == lengths
        for name, group in seen.items():
            assert torch.equal(other.get_observations()[name], group), name
        assert record(other, actions[21:]) == expected

    def test_load_restores_buffers_that_a_term_makes_later(self, random_env):
        env, other = random_env(3), random_env(3)
        env.buffers["clock"] = np.arange(3, dtype=np.float32)
        saved = env_state(env)
        load_env_state(other, saved)
        assert other.buffers["clock"].tolist() == [0, 1, 2]
        other.buffers["clock"] += 1
        assert saved["arrays"]["buffers.clock"].tolist() == [0, 1, 2]

    @pytest.mark.parametrize("name", ["buffers.steps_until_push", "state.foot_force"])
    def test_load_rejects_other_version(self, random_env, name):
        saved = env_state(random_env(3))
        del saved["arrays"][name]
        with pytest.raises(ConfigError, match=rf"env\.arrays\.{name}: got nothing; expected"):
            load_env_state(random_env(3), saved)
        load_env_state(random_env(4), saved)

    def test_load_rejects_other_robot_or_map(self, random_env, biped, map_ground):
        saved = env_state(random_env(3))
        for robot, ground, told in (
            (biped, None, r"physics: got float64 \(3, \d+\); expected"),
            (biped, map_ground, r"visits: got float64 \(1, 1\); expected"),
        ):
            with pytest.raises(ConfigError, match=told):
                load_env_state(random_env(3, ground, robot), saved)


class TestSetCommands:
    HELD = np.float32([[0.5, -0.3, 0.2]] * 4)

    def test_fixed_commands_are_never_resampled(self, random_env):
        env = random_env(commands=Commands(resampling_time=0.04, heading_command=True))
        env.set_commands(self.HELD)
        for step in range(10):
            if step == 5:
                env.reset()
            if step == 7:
                env.sim.qpos[1, 3:7] = (0, 1, 0, 0)
            np.testing.assert_allclose(observed_commands(env), self.HELD, atol=1e-6)
            dones = stand(env)[2]
            assert dones.tolist() == [False, step == 7, False, False]
            np.testing.assert_allclose(env.state.commands, self.HELD)

    def test_none_returns_to_random_commands(self, random_env):
        env = random_env(commands=Commands(standing=0.0, resampling_time=0.06))
        env.set_commands(self.HELD)
        stand(env)
        env.set_commands(None)
        assert (env.commands[:, :2] != self.HELD[:, :2]).any(axis=1).all()
        np.testing.assert_array_equal(env.state.commands, env.commands)
        np.testing.assert_allclose(observed_commands(env), env.commands, atol=1e-6)
        drawn = env.commands.copy()
        env.set_commands(None)  # there is nothing to let go
        stand(env)
        np.testing.assert_array_equal(env.commands, drawn)
        stand(env)  # the time to sample again
        assert (env.commands != drawn).any(axis=1).all()
        assert (env.commands[:, :2] != self.HELD[:, :2]).any(axis=1).all()


# Joints of the cart: wheel_axle, rear_hinge, front_hinge.
Q = np.array([0.4, -0.3, 0.5])
DQ = np.array([2.0, -1.0, 0.5])


@pytest.fixture
def torques(nominal_env, cart):
    """Return the torques of an action in one physics step, from `Q` and `DQ` in the air."""

    def act(action, offset=(0.0, 0.0, 0.0), **settings):
        env = nominal_env(1, robot=cart, control=Control(**settings))
        sim, scene = env.sim, env.scene
        sim.qpos[0] = scene.default_qpos
        sim.qpos[0, 2] = 5.0
        sim.qpos[0, scene.joint_qpos] = Q
        sim.qvel[0] = 0
        sim.qvel[0, scene.joint_qvel] = DQ
        env.joint_offset[:] = offset
        sim.ctrl[:] = env.to_ctrl(np.float32([action]))
        sim.step(1)
        return sim.torque[0].copy()

    return act


class TestControl:
    @pytest.mark.parametrize(
        ("action", "settings", "expected"), read_table(__file__, "torques_by_hand")
    )
    def test_torques_by_hand(self, torques, action, settings, expected):
        np.testing.assert_allclose(torques(action, **settings), expected, rtol=1e-6)

    # A motor that measures 0.05 rad too much moves 0.05 rad too little.
    @pytest.mark.parametrize(("kind", "less"), [("P", [0, 20 * 0.05, 20 * 0.05]), ("V", [0, 0, 0])])
    def test_joint_offset_shifts_the_target_position(self, torques, kind, less):
        plain = torques((0.2, 0.0, 0.1), control_type=kind)
        shifted = torques((0.2, 0.0, 0.1), offset=(0.05, 0.05, 0.05), control_type=kind)
        np.testing.assert_allclose(plain - shifted, less, rtol=1e-5)


class TestJointsWithoutAction:
    @pytest.mark.parametrize("control", [Control(), Control(action_scale=0.5)])
    def test_they_hold_the_default_pose(self, nominal_env, held_calves, control):
        robot = Robot.load(held_calves)
        env = nominal_env(2, robot=robot, control=control)
        calves = np.array([name.endswith("calf_joint") for name in robot.spec.joint_order])
        np.testing.assert_array_equal(env.actions.joints, np.flatnonzero(~calves))
        actions = np.arange(-8, 8, dtype=np.float32).reshape(2, 8) / 10
        moved = env.to_ctrl(actions) - robot.default_pose
        np.testing.assert_array_equal(moved[:, calves], 0)
        scaled = actions * (control.action_scale or 0.25)
        np.testing.assert_allclose(moved[:, ~calves], scaled, atol=1e-6)
        observations = env.step(torch.from_numpy(actions))[0]["policy"]
        assert observations.shape == (2, 3 * (47 - 4))
        np.testing.assert_array_equal(env.state.actions, actions)
        with pytest.raises(ConfigError, match=r"got \(2, 12\); expected \(2, 8\)"):
            env.step(torch.zeros(2, 12))

    def test_a_robot_without_actions_is_rejected(self, nominal_env, quadruped):
        robot = replace(quadruped, action_scale=np.zeros(12, np.float32))
        with pytest.raises(ConfigError, match="action_scale of quadruped: got 0 for every joint"):
            nominal_env(2, robot=robot)
