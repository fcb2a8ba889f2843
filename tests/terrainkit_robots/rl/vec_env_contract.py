"""Tests that every implementation of rsl-rl's `VecEnv` must pass.

Subclass `VecEnvContract` and give it a fixture `env`: a new environment whose episodes are short.
"""

import numpy as np
import pytest
import torch
from rsl_rl.env import VecEnv
from tensordict import TensorDict

from terrainkit.errors import ConfigError

_STEPS = 12


class VecEnvContract:
    """Properties that the runner relies on; the subclass provides the fixture `env`."""

    @staticmethod
    def actions(env, seed=0):
        made = torch.Generator().manual_seed(seed)
        return 0.5 * torch.randn(env.num_envs, env.num_actions, generator=made)

    def run(self, env, steps=_STEPS):
        return [env.step(self.actions(env, k)) for k in range(steps)]

    def test_env_has_all_attributes(self, env):
        assert isinstance(env, VecEnv)
        for count in (env.num_envs, env.num_actions):
            assert isinstance(count, int)
            assert count > 0
        assert int(env.max_episode_length) > 0
        assert env.cfg is not None
        assert torch.device(env.device).type == "cpu"
        assert env.episode_length_buf.dtype == torch.long
        assert env.episode_length_buf.tolist() == [0] * env.num_envs

    def test_observations_are_finite_float_groups(self, env):
        shapes = {name: group.shape for name, group in env.get_observations().items()}
        for observed in (env.get_observations(), *(step[0] for step in self.run(env))):
            assert isinstance(observed, TensorDict)
            assert observed.batch_size == (env.num_envs,)
            assert observed.device is None or observed.device == torch.device(env.device)
            assert {name: group.shape for name, group in observed.items()} == shapes
            for group in observed.values():
                assert group.dtype == torch.float32
                assert group.ndim == 2
                assert group.shape[0] == env.num_envs
                assert group.device == torch.device(env.device)
                assert torch.isfinite(group).all()

    def test_rewards_and_dones_have_shape_num_envs(self, env):
        for _, rewards, dones, extras in self.run(env):
            assert rewards.shape == dones.shape == extras["time_outs"].shape == (env.num_envs,)
            assert extras["time_outs"].device == torch.device(env.device)
            assert rewards.dtype == torch.float32
            assert dones.dtype in (torch.bool, torch.long, torch.uint8)
            assert torch.isfinite(rewards).all()
            assert rewards.device == dones.device == torch.device(env.device)

    def test_returned_tensors_never_change(self, env):
        # A view of a live array would change with the next step.
        kept = list(env.get_observations().values())
        copies = [part.clone() for part in kept]
        for k in range(_STEPS):
            observed, rewards, dones, extras = env.step(self.actions(env, k))
            kept += [*observed.values(), rewards, dones, extras["time_outs"]]
            copies += [part.clone() for part in kept[len(copies) :]]
        for before, after in zip(copies, kept, strict=True):
            assert torch.equal(before, after)

    def test_get_observations_matches_step(self, env):
        for k in range(_STEPS):
            observed, *_ = env.step(self.actions(env, k))
            for again in (env.get_observations(), env.get_observations()):
                for name, group in observed.items():
                    assert torch.equal(group, again[name]), name

    def test_time_out_at_max_episode_length(self, env):
        longest, seen = int(env.max_episode_length), 0
        for k in range(longest + 3):
            lengths = env.episode_length_buf.clone()
            _, _, dones, extras = env.step(self.actions(env, k))
            out = extras["time_outs"].bool()
            assert dones.bool()[out].all()
            assert (lengths[out] + 1 >= longest).all()
            # An episode of that length is done, by a time-out or by a fall.
            assert dones.bool()[lengths + 1 >= longest].all()
            seen += int(out.sum())
        assert seen > 0

    def test_done_episodes_are_reset(self, env):
        for k in range(int(env.max_episode_length) + 3):
            lengths = env.episode_length_buf.clone()
            _, _, dones, _ = env.step(self.actions(env, k))
            expected = torch.where(dones.bool(), torch.zeros_like(lengths), lengths + 1)
            assert torch.equal(env.episode_length_buf, expected)

    def test_episode_lengths_can_be_replaced(self, env):
        longest = int(env.max_episode_length)
        ages = torch.arange(env.num_envs) % longest
        ages[0] = longest - 1
        env.episode_length_buf = ages.clone()
        _, _, dones, extras = env.step(torch.zeros(env.num_envs, env.num_actions))
        assert dones.bool()[0]
        assert extras["time_outs"].bool()[0]
        assert env.episode_length_buf[0] == 0
        alive = ~dones.bool()
        assert torch.equal(env.episode_length_buf[alive], ages[alive] + 1)

    def test_log_has_scalars_with_sections(self, env):
        logs = [s[3]["log"] for s in self.run(env, int(env.max_episode_length)) if "log" in s[3]]
        assert logs
        for name, value in (item for log in logs for item in log.items()):
            assert "/" in name
            assert np.ndim(value) == 0
            assert np.isfinite(float(value)), name

    def test_step_leaves_actions_unchanged(self, env):
        actions = self.actions(env).requires_grad_()
        before = actions.detach().clone()
        observed, rewards, *_ = env.step(actions)
        assert torch.equal(actions.detach(), before)
        assert not rewards.requires_grad
        assert not any(group.requires_grad for group in observed.values())

    def test_large_actions_stay_finite(self, env):
        for sign in (1, -1, 1):
            actions = torch.full((env.num_envs, env.num_actions), sign * 1e30)
            observed, rewards, *_ = env.step(actions)
            assert torch.isfinite(rewards).all()
            assert all(torch.isfinite(group).all() for group in observed.values())

    @pytest.mark.parametrize("strange", [np.nan, np.inf, -np.inf])
    def test_step_rejects_nonfinite_actions(self, env, strange):
        actions = self.actions(env)
        actions[-1, 1] = strange
        before = env.episode_length_buf.clone()
        with pytest.raises(ConfigError, match=f"actions of environment {env.num_envs - 1} "):
            env.step(actions)
        assert torch.equal(env.episode_length_buf, before)
        env.step(self.actions(env))

    @pytest.mark.parametrize(("more_envs", "more_actions"), [(1, 0), (0, 1), (0, -1)])
    def test_step_rejects_wrong_action_shape(self, env, more_envs, more_actions):
        wrong = torch.zeros(env.num_envs + more_envs, env.num_actions + more_actions)
        for actions in (wrong, wrong[0]):
            with pytest.raises(ConfigError, match="shape of the actions"):
                env.step(actions)
