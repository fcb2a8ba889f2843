"""Tests that every implementation of rsl-rl's `VecEnv` must pass.

Subclass `VecEnvContract` and give it a fixture `env`: a new environment whose episodes are short.
"""

from typing import Any

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
    def actions(env: VecEnv, seed: int = 0) -> torch.Tensor:
        made = torch.Generator().manual_seed(seed)
        return 0.5 * torch.randn(env.num_envs, env.num_actions, generator=made)

    def run(self, env: VecEnv, steps: int = _STEPS) -> list[Any]:
        return [env.step(self.actions(env, k)) for k in range(steps)]

    def test_env_has_all_attributes(self, env: VecEnv) -> None:
        assert isinstance(env, VecEnv)
        assert isinstance(env.num_envs, int)
        assert env.num_envs > 0
        assert isinstance(env.num_actions, int)
        assert env.num_actions > 0
        assert int(env.max_episode_length) > 0
        assert env.cfg is not None
        assert torch.device(env.device).type == "cpu"

    def test_episode_lengths_are_integers(self, env: VecEnv) -> None:
        assert env.episode_length_buf.shape == (env.num_envs,)
        assert env.episode_length_buf.dtype == torch.long
        assert (env.episode_length_buf == 0).all()

    def test_observations_are_finite_float_groups(self, env: VecEnv) -> None:
        for observed in (env.get_observations(), *(step[0] for step in self.run(env))):
            assert isinstance(observed, TensorDict)
            assert observed.batch_size == (env.num_envs,)
            assert observed.device is None or observed.device == torch.device(env.device)
            for group in observed.values():
                assert group.dtype == torch.float32
                assert group.ndim == 2
                assert group.shape[0] == env.num_envs
                assert group.device == torch.device(env.device)
                assert torch.isfinite(group).all()

    def test_observation_shapes_are_constant(self, env: VecEnv) -> None:
        before = {name: group.shape for name, group in env.get_observations().items()}
        for observed, *_ in self.run(env):
            assert {name: group.shape for name, group in observed.items()} == before

    def test_rewards_and_dones_have_shape_num_envs(self, env: VecEnv) -> None:
        for _, rewards, dones, _ in self.run(env):
            assert rewards.shape == dones.shape == (env.num_envs,)
            assert rewards.dtype == torch.float32
            assert dones.dtype in (torch.bool, torch.long, torch.uint8)
            assert torch.isfinite(rewards).all()
            assert rewards.device == dones.device == torch.device(env.device)

    def test_returned_tensors_never_change(self, env: VecEnv) -> None:
        # A view of a live array would change with the next step.
        kept, copies = [], []
        first = env.get_observations()
        kept.append(dict(first.items()))
        copies.append({name: group.clone() for name, group in first.items()})
        for observed, rewards, dones, extras in self.run(env):
            parts = dict(observed.items()) | {"r": rewards, "d": dones, "t": extras["time_outs"]}
            kept.append(parts)
            copies.append({name: part.clone() for name, part in parts.items()})
        for before, after in zip(copies, kept, strict=True):
            for name in before:
                assert torch.equal(before[name], after[name]), name

    def test_get_observations_matches_step(self, env: VecEnv) -> None:
        for k in range(_STEPS):
            observed, *_ = env.step(self.actions(env, k))
            again = env.get_observations()
            for name, group in observed.items():
                assert torch.equal(group, again[name]), name

    def test_get_observations_is_repeatable(self, env: VecEnv) -> None:
        once, twice = env.get_observations(), env.get_observations()
        for name, group in once.items():
            assert torch.equal(group, twice[name])

    def test_every_step_has_time_outs(self, env: VecEnv) -> None:
        for *_, extras in self.run(env):
            assert extras["time_outs"].shape == (env.num_envs,)
            assert extras["time_outs"].device == torch.device(env.device)

    def test_time_out_at_max_episode_length(self, env: VecEnv) -> None:
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

    def test_done_episodes_are_reset(self, env: VecEnv) -> None:
        for k in range(int(env.max_episode_length) + 3):
            lengths = env.episode_length_buf.clone()
            _, _, dones, _ = env.step(self.actions(env, k))
            expected = torch.where(dones.bool(), torch.zeros_like(lengths), lengths + 1)
            assert torch.equal(env.episode_length_buf, expected)

    def test_episode_lengths_can_be_replaced(self, env: VecEnv) -> None:
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

    def test_log_has_scalars_with_sections(self, env: VecEnv) -> None:
        logs = [s[3]["log"] for s in self.run(env, int(env.max_episode_length)) if "log" in s[3]]
        assert logs
        for name, value in (item for log in logs for item in log.items()):
            assert "/" in name
            assert np.ndim(value) == 0
            assert np.isfinite(float(value)), name

    def test_step_leaves_actions_unchanged(self, env: VecEnv) -> None:
        actions = self.actions(env).requires_grad_()
        before = actions.detach().clone()
        observed, rewards, *_ = env.step(actions)
        assert torch.equal(actions.detach(), before)
        assert not rewards.requires_grad
        assert not any(group.requires_grad for group in observed.values())

    def test_large_actions_stay_finite(self, env: VecEnv) -> None:
        for sign in (1, -1, 1):
            actions = torch.full((env.num_envs, env.num_actions), sign * 1e30)
            observed, rewards, *_ = env.step(actions)
            assert torch.isfinite(rewards).all()
            assert all(torch.isfinite(group).all() for group in observed.values())

    @pytest.mark.parametrize("strange", [np.nan, np.inf, -np.inf])
    def test_step_rejects_nonfinite_actions(self, env: VecEnv, strange: float) -> None:
        actions = self.actions(env)
        actions[-1, 1] = strange
        before = env.episode_length_buf.clone()
        with pytest.raises(ConfigError, match=f"actions of environment {env.num_envs - 1} "):
            env.step(actions)
        assert torch.equal(env.episode_length_buf, before)
        env.step(self.actions(env))

    @pytest.mark.parametrize(("more_envs", "more_actions"), [(1, 0), (0, 1), (0, -1)])
    def test_step_rejects_wrong_action_shape(
        self, env: VecEnv, more_envs: int, more_actions: int
    ) -> None:
        wrong = torch.zeros(env.num_envs + more_envs, env.num_actions + more_actions)
        with pytest.raises(ConfigError, match="shape of the actions"):
            env.step(wrong)

    def test_step_rejects_single_row_of_actions(self, env: VecEnv) -> None:
        with pytest.raises(ConfigError, match="shape of the actions"):
            env.step(torch.zeros(env.num_actions))
