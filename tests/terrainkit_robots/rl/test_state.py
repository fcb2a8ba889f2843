from dataclasses import replace

import mujoco
import numpy as np
import pytest
import torch

from terrainkit_robots.rl.config import Commands, Terrain
from terrainkit_robots.rl.state import CONTACT_FORCE, NEAR_FOOT
from terrainkit_robots.rl.terrain import Plane
from tests.tables import read_table


@pytest.fixture
def moving(nominal_env, cart):
    """Return carts that tumble in the air."""
    env = nominal_env(5, robot=cart)
    rng = np.random.default_rng(2)
    env.sim.qpos[:, 2] = 2.0
    env.sim.qvel[:] = rng.normal(size=env.sim.qvel.shape)
    env.step(torch.from_numpy(rng.normal(size=(5, 3)).astype(np.float32)))
    return env


def test_feet_touch_the_ground_by_their_vertical_force(moving):
    force = np.zeros((5, moving.state.foot_force.shape[1], 3), np.float32)
    force[0, 0, 2], force[1, 0, 0], force[2, 0, 2] = CONTACT_FORCE + 0.01, 99, CONTACT_FORCE - 0.01
    state = replace(moving.state, foot_force=force)
    assert state.foot_contact[:, 0].tolist() == [True, False, False, False, False]


def test_state_matches_mujoco(moving):
    state, model, data = moving.state, moving.scene.model, mujoco.MjData(moving.scene.model)
    for k in range(5):
        data.qpos[:], data.qvel[:] = moving.sim.qpos[k], moving.sim.qvel[k]
        mujoco.mj_forward(model, data)
        base, velocity = data.body("trunk"), np.zeros(6)
        mujoco.mj_objectVelocity(model, data, mujoco.mjtObj.mjOBJ_XBODY, base.id, velocity, 1)
        found = [*state.base_ang_vel[k], *state.base_lin_vel[k]]
        np.testing.assert_allclose(found, velocity, atol=1e-5)
        up = base.xmat.reshape(3, 3)[2]
        np.testing.assert_allclose(state.projected_gravity[k], -up, atol=1e-5)
        joints = [data.joint(name).qvel[0] for name in ("wheel_axle", "rear_hinge", "front_hinge")]
        np.testing.assert_allclose(state.dof_vel[k], joints, atol=1e-5)  # in the order of the spec
        # The radius of the foot is subtracted.
        assert state.foot_height[k, 0] == pytest.approx(data.body("wheel").xpos[2] - 0.03, abs=1e-5)
    assert np.abs(state.base_lin_vel).max() > 0.5


class TestByHand:
    @pytest.mark.parametrize(("name", "weight"), [("biped", 1 / 100), ("quadruped", 1.0)])
    def test_mean_vel_is_averaged_over_the_gait_on_two_legs(
        self, request, nominal_env, name, weight
    ):
        # 2 s at 50 Hz: each step moves the mean by 1 / 100 of its distance to the velocity.
        robot = request.getfixturevalue(name)
        env = nominal_env(2, robot=robot, commands=Commands(gait_period=2.0))
        expected = env.state.mean_vel
        assert not expected.any()
        for _ in range(5):
            env.step(torch.ones(2, env.num_actions))
            now = env.state
            vel = np.stack([*now.base_lin_vel[:, :2].T, now.base_ang_vel[:, 2]], axis=1)
            expected = expected + (vel - expected) * weight
            np.testing.assert_allclose(now.mean_vel, expected, rtol=1e-5)
        assert np.abs(expected).min() > 0
        env.reset()
        assert not env.state.mean_vel.any()

    def test_state_at_rest(self, nominal_env, cart):
        state = nominal_env(2, robot=cart).state
        np.testing.assert_allclose(state.base_pos, [[0, 0, 0.24]] * 2, atol=1e-6)
        np.testing.assert_allclose(state.base_height, [0.24] * 2, atol=1e-6)
        np.testing.assert_allclose(state.projected_gravity, [[0, 0, -1]] * 2, atol=1e-7)
        np.testing.assert_allclose(state.dof_pos, [cart.default_pose] * 2, atol=1e-6)
        zero = "base_lin_vel dof_vel dof_acc actions torques foot_force penalized_force"
        for name in zero.split():
            assert not getattr(state, name).any(), name
        assert not state.fallen.any()
        # The wheel hangs on a leg of 0.2 m that is rotated by -0.2 rad.
        wheel = 0.24 - 0.2 * np.cos(0.2) - 0.03
        np.testing.assert_allclose(state.foot_height[:, 0], wheel, atol=1e-5)

    def test_scan_turns_with_the_yaw(self, nominal_env, map_ground):
        points = Terrain(measured_points_x=(0.3,), measured_points_y=(-0.2, 0.1))
        env = nominal_env(1, map_ground, terrain=points)
        half = np.sqrt(0.5)
        turned = np.array([[half, 0, 0, half], [0, 0, 0, 1]], np.float32)  # by 90 and 180 degrees
        x, y, _ = env.sensors.scan_points(np.float32([[1, 2, 0.5]] * 2), turned)
        np.testing.assert_allclose(x, [[1.2, 0.9], [0.7, 0.7]], atol=1e-6)
        np.testing.assert_allclose(y, [[2.3, 2.3], [2.2, 1.9]], atol=1e-6)

    def test_scan_has_points_around_the_feet(self, quadruped, nominal_env, map_ground):
        grid = {"measured_points_x": (0.3,), "measured_points_y": (0.0,)}
        points = Terrain(**grid, foot_points_x=(-0.1, 0.2), foot_points_y=(0.0, 0.05))
        env = nominal_env(1, map_ground, robot=quadruped, terrain=points)
        x, y, _ = env.sensors.scan_points(np.float32([[1, 2, 0.5]]), np.float32([[1, 0, 0, 0]]))
        assert (x[0, 0], y[0, 0]) == pytest.approx((1.3, 2.0))
        at_feet = np.stack([x[0, 1:], y[0, 1:]], axis=1).reshape(4, 4, 2) - (1, 2)
        offsets = at_feet - env.scene.foot_pos[:, None, :2]
        expected = [[-0.1, 0], [-0.1, 0.05], [0.2, 0], [0.2, 0.05]]
        np.testing.assert_allclose(offsets, [expected] * 4, atol=1e-6)

    def test_steps_are_compared_with_the_previous_one(self, nominal_env, cart):
        env = nominal_env(2, robot=cart)
        before = env.state.dof_vel.copy()
        for value in (0.1, 0.2, 0.3):
            env.step(torch.full((2, 3), value))
            expected = (env.state.dof_vel - before) / env.cfg.dt
            np.testing.assert_allclose(env.state.dof_acc, expected, rtol=1e-4, atol=1e-4)
            np.testing.assert_allclose(env.state.actions, value)
            np.testing.assert_allclose(env.state.last_actions, value - 0.1, atol=1e-6)
            before = env.state.dof_vel.copy()

    def test_foot_air_time_is_counted_until_the_foot_lands(self, nominal_env, cart):
        env = nominal_env(2, robot=cart)
        contact = np.zeros((2, env.state.foot_force.shape[1]), bool)
        measured = env.sim.sensor

        def sensor(name, rows=slice(None)):
            if name != "foot_force":
                return measured(name, rows)
            force = np.zeros((*contact.shape, 3), np.float32)
            force[..., 2] = np.where(contact, -2 * CONTACT_FORCE, 0)  # on the ground
            return force[rows]

        env.sim.sensor = sensor
        assert not env.state.foot_air_time.any()
        # A foot that stands after a reset has not landed. Then it swings for three steps.
        for touching, steps in zip("1100011", (0, 0, 1, 2, 3, 4, 0), strict=True):
            contact[0, 0] = touching == "1"
            env.step(torch.zeros(2, 3))
            assert env.state.foot_air_time[0, 0] == pytest.approx(steps * env.cfg.dt)
        assert env.state.foot_air_time[1, 0] == pytest.approx(7 * env.cfg.dt)
        env.sim.qpos[1, 3:7] = (0, 1, 0, 0)  # a fall
        *_, dones, _ = env.step(torch.zeros(2, 3))
        assert dones.tolist() == [False, True]
        assert not env.state.foot_air_time[1].any()
        env.step(torch.zeros(2, 3))
        assert env.state.foot_air_time[1, 0] == pytest.approx(env.cfg.dt)

    @pytest.mark.parametrize(("name", "most"), [("quadruped", 1.26), ("biped", 0.76)])
    def test_pushes_are_weaker_on_two_legs(
        self, request, nominal_env, no_randomization, name, most
    ):
        pushed = replace(no_randomization, push_interval_s=0.02, max_push_vel_xy=None)
        env = nominal_env(64, robot=request.getfixturevalue(name), domain_rand=pushed)
        env.step(torch.zeros(64, env.num_actions))
        assert 0.9 * most < np.abs(env.push_vel).max() <= most

    def test_push_adds_to_world_velocity(self, nominal_env, cart, no_randomization):
        pushed = replace(no_randomization, push_interval_s=0.04, max_push_vel_xy=0.8)
        env = nominal_env(64, robot=cart, domain_rand=pushed)
        env.sim.qpos[:, 2] = 3.0
        seen = []
        for _ in range(4):
            before = env.sim.qvel[:, :2].copy()
            env.step(torch.zeros(64, 3))
            added = env.sim.qvel[:, :2] - before
            np.testing.assert_allclose(added, env.push_vel[:, :2], atol=0.05)
            assert (env.push_vel[:, 2] == 0).all()
            assert 0.7 < np.abs(env.push_vel).max() <= 0.8
            seen.append((env.push_vel != 0).any(axis=1))
        # Each robot every 0.04 s; the state has only the push of the step.
        np.testing.assert_array_equal(seen[0], ~seen[1])
        np.testing.assert_array_equal(seen[2:], seen[:2])


def env_and_foot(nominal_env, ground):
    """Return an environment on a ground, and the position of its first foot [m]."""
    env = nominal_env(1, ground)
    env.sim.batch.forward(np.array([0]), stage=mujoco.mjtStage.mjSTAGE_VEL)
    return env, env.sim.sensor("foot_position", np.array([0]))[0, 0, :2]


def read_feet(env, command):
    """Return how far edges are above the ground of the first foot, and the depths near it [m]."""
    fields = env.sensors.read(np.array([0]), None, np.float32([command]))
    difference = fields["foot_height"] - fields["foot_height_over_edges"]
    return difference[0, 0], fields["foot_ground_depth"][0, 0]


class _Steps(Plane):
    """A plane that is measured as steps along y, each from an edge to an edge at a height."""

    is_plane = False

    steps = ()

    def height(self, _, y, *__, **___):
        height = np.zeros_like(y)
        for start, end, top in self.steps:
            height[(y > start) & (y < end)] = top
        return height


# Distances in units of `NEAR_FOOT`, for a foot at 0 that moves to the left.
@pytest.mark.parametrize(("steps", "clearance"), read_table(__file__, "clearance_is_above_edges"))
def test_clearance_is_above_edges_ahead_and_gaps(nominal_env, quadruped, steps, clearance):
    ground = _Steps()
    env, (_, foot) = env_and_foot(nominal_env, ground)
    unit = NEAR_FOOT * quadruped.leg_length
    ground.steps = [(foot + unit * a, foot + unit * b, top) for a, b, top in steps]
    assert read_feet(env, [0, 0.5, 0])[0] == pytest.approx(clearance, abs=1e-6)


def test_feet_clear_no_edge_beside_them(nominal_env, quadruped):
    ground = _Steps()
    env, (_, foot) = env_and_foot(nominal_env, ground)
    ground.steps = [(foot + 0.5 * NEAR_FOOT * quadruped.leg_length, 9, 0.1)]
    turned = np.sqrt(0.5), 0, 0, np.sqrt(0.5)  # forward is to the left
    for command, quat, clearance in [
        ([0.5, 0, 0], (1, 0, 0, 0), 0),
        ([0, 0, 1], (1, 0, 0, 0), 0),
        ([0, 0.5, 0], (1, 0, 0, 0), 0.1),
        ([0.5, 0, 0], turned, 0.1),
        ([0, 0.5, 0], turned, 0),
    ]:
        env.sim.qpos[0, 3:7] = quat  # the sensors keep the position of the foot
        assert read_feet(env, command)[0] == pytest.approx(clearance, abs=1e-6)


class _Stones(Plane):
    """A plane that is measured as stones around the point `at`, where gaps of a width cross."""

    is_plane = False

    at, widths = (0.0, 0.0), (0.0, 0.0)

    def height(self, x, y, *_, **__):
        distances = np.abs(x - self.at[0]), np.abs(y - self.at[1])
        in_gap = [each < width / 2 for each, width in zip(distances, self.widths, strict=True)]
        return -np.logical_or(*in_gap).astype(np.float32)


# Widths in units of `NEAR_FOOT`, across and along the direction of a foot in the gap.
@pytest.mark.parametrize(
    ("widths", "clearance"),
    [((1.5, 0), 1), ((0, 1.5), 1), ((1.5, 1.5), 1), ((0, 3.9), 1), ((0, 4.1), 0), ((4.1, 4.1), 0)],
)
def test_feet_clear_gaps_between_stones_in_any_direction(nominal_env, quadruped, widths, clearance):
    ground = _Stones()
    env, ground.at = env_and_foot(nominal_env, ground)
    ground.widths = NEAR_FOOT * quadruped.leg_length * np.array(widths)
    assert read_feet(env, [0.5, 0, 0])[0] == pytest.approx(clearance, abs=1e-6)


def test_ground_near_feet_is_deep_over_a_gap(nominal_env, quadruped):
    ground = _Stones()
    env, foot = env_and_foot(nominal_env, ground)
    unit = NEAR_FOOT * quadruped.leg_length
    ground.widths = 0, 1.5 * unit
    for offset, depth in [(0, [1, 1, 1, 0, 0]), (1, [0, 0, 0, 0, 1]), (2, [0, 0, 0, 0, 0])]:
        ground.at = foot[0], foot[1] + offset * unit  # the middle of the gap is to the left
        np.testing.assert_allclose(read_feet(env, [0.5, 0, 0])[1], depth, atol=1e-6)


class TestStateCopies:
    def test_state_shares_no_memory(self, random_env):
        # A reward that modifies the state must not change the simulation.
        env = random_env(3)
        env.step(torch.zeros(3, 12))
        own = [env.sim.batch.state, *vars(env.params).values(), env.commands]
        own += [env.joint_offset, env.push_vel, env.action_history]
        for name, value in vars(env.state).items():
            assert not any(np.shares_memory(value, other) for other in own), name

    def test_state_is_single_precision(self, nominal_env, map_ground):
        env = nominal_env(3, map_ground)
        env.step(torch.zeros(3, 12))
        for name, value in vars(env.state).items():
            assert value.dtype in (np.float32, np.bool_), name

    def test_state_after_reset_is_fresh(self, nominal_env, quadruped):
        env = nominal_env(3)
        for _ in range(30):
            env.step(torch.full((3, 12), 0.5))
        env.sim.qpos[1, 3:7] = (0, 1, 0, 0)  # on its back: a fall
        _, _, dones, _ = env.step(torch.zeros(3, 12))
        assert dones.tolist() == [False, True, False]
        new = nominal_env(3).state
        for name, fresh in vars(new).items():
            if name not in (
                "commands",
                "gait_phase",
                "foot_height",
                "foot_height_over_edges",
                "foot_vel",
            ):
                found = getattr(env.state, name)[1]
                np.testing.assert_allclose(found, fresh[1], atol=1e-6, err_msg=name)
        where = np.array([1])
        env.sim.batch.forward(where, stage=mujoco.mjtStage.mjSTAGE_VEL)
        feet = env.sim.sensor("foot_position", where)[0]
        expected = feet[:, 2] - quadruped.spec.foot_radius
        np.testing.assert_allclose(env.state.foot_height[1], expected, atol=1e-5)
