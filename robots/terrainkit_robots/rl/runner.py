"""The runner: rsl-rl's, so that it goes on exactly where a checkpoint ends, and keeps quiet."""

import os
import statistics
import time
from collections.abc import Callable, Mapping
from pathlib import Path
from typing import Any

os.environ.setdefault("GIT_PYTHON_REFRESH", "quiet")  # rsl-rl asks for git, which may be missing

import numpy as np
import torch
from rsl_rl.runners import OnPolicyRunner

from terrainkit.errors import ConfigError, listing
from terrainkit_robots.rl.checkpoint import read_checkpoint, save_checkpoint
from terrainkit_robots.rl.curves import Curves, quiet
from terrainkit_robots.rl.env import LeggedEnv
from terrainkit_robots.rl.policy import GROUPS, actor_config, fitting, refuse_other, widths
from terrainkit_robots.rl.progress import Progress, Watch, nobody
from terrainkit_robots.rl.run_folder import checkpoint_name
from terrainkit_robots.rl.task import Task


def runner_config(task: Task) -> dict[str, Any]:
    """Return what rsl-rl's runner wants to know, from a task."""
    return {
        "num_steps_per_env": task.runner.num_steps_per_env,
        "save_interval": task.runner.save_interval,
        "seed": task.runner.seed,
        "logger": _logger_config(task),
        "obs_groups": {name: list(groups) for name, groups in GROUPS.items()},
        "actor": {"class_name": "MLPModel", **actor_config(task)},
        "critic": {
            "class_name": "MLPModel",
            "hidden_dims": list(task.policy.critic_hidden_dims),
            "activation": task.policy.activation,
            "obs_normalization": task.policy.obs_normalization,
        },
        "algorithm": _algorithm_config(task),
    }


def _algorithm_config(task: Task) -> dict[str, Any]:
    own = dict(vars(task.algorithm))
    symmetry, mirror_loss = own.pop("symmetry"), own.pop("mirror_loss_coeff")
    config = {"class_name": "PPO", **own, "rnd_cfg": None, "symmetry_cfg": None}
    if symmetry != "none":
        from terrainkit_robots.rl.symmetry import mirrored

        config["symmetry_cfg"] = {
            "data_augmentation_func": mirrored,
            "use_data_augmentation": symmetry == "augmentation",
            "use_mirror_loss": symmetry == "loss",
            "mirror_loss_coeff": mirror_loss,
        }
    return config


def _logger_config(task: Task) -> str | dict[str, str]:
    if task.runner.logger == "wandb":
        return {"class_name": "WandbLogWriter", "project_name": "terrainkit"}
    return "tensorboard"


class LeggedRunner(OnPolicyRunner):
    """Lets the robots of an environment act, and learns from it, again and again."""

    env: LeggedEnv

    def __init__(
        self,
        env: LeggedEnv,
        folder: Path | None = None,
        device: str = "cpu",
        *,
        watch: Watch = nobody,
        stop: Callable[[], object] = lambda: False,
    ) -> None:
        """Make the networks.

        Args:
            env: The environment.
            folder: Where checkpoints and curves go; None for nowhere.
            device: Where the networks are: `cpu`, `cuda`, `cuda:1`.
            watch: Told of the progress after each iteration.
            stop: Asked before each iteration; training ends, with a checkpoint, once it is true.
        """
        self.folder, self.watch, self.stop = folder, watch, stop
        with quiet():
            super().__init__(env, runner_config(env.cfg), None, device)
        self.first = self.gpu_global_rank == 0
        self.logger = Curves(
            log_dir=None,
            cfg=self.cfg,
            env_cfg=env.cfg,
            num_envs=env.num_envs,
            is_distributed=self.is_distributed,
            gpu_world_size=self.gpu_world_size,
            gpu_global_rank=self.gpu_global_rank,
            device=device,
        )
        self._obs = env.get_observations().to(device)

    def learn(self, num_learning_iterations: int, init_at_random_ep_len: bool = False) -> None:
        """Learn.

        Args:
            num_learning_iterations: How many times, from here on.
            init_at_random_ep_len: Cut the first episodes to random lengths, so that not all robots
                begin anew at the same time.

        Raises:
            ConfigError: if the networks diverge.
            ExportError: if the disk does not take a checkpoint.
        """
        first, begun = self.current_learning_iteration, time.perf_counter()
        last, saved = first + num_learning_iterations, -1
        if init_at_random_ep_len:
            self.env.episode_length_buf = torch.randint_like(
                self.env.episode_length_buf, high=self.env.max_episode_length
            )
        self.alg.train_mode()
        if self.is_distributed:
            self.alg.broadcast_parameters()
        with self.logger.writing(self.folder):
            while self.current_learning_iteration < last and not self._asked_to_stop():
                start = time.perf_counter()
                self._collect()
                collected = time.perf_counter()
                losses = self._update()
                learned = time.perf_counter()
                self.current_learning_iteration += 1
                pace = (learned - begun) / (self.current_learning_iteration - first)
                self._tell(losses, collected - start, learned - collected, last, pace)
                if self.current_learning_iteration % self.cfg["save_interval"] == 0:
                    self.save()
                    saved = self.current_learning_iteration
            if saved != self.current_learning_iteration:
                self.save()

    def _collect(self) -> None:
        """Let the robots act for a few steps, and note what comes of it."""
        with torch.inference_mode():
            for _ in range(self.cfg["num_steps_per_env"]):
                actions = self.alg.act(self._obs)
                obs, rewards, dones, extras = self.env.step(actions)
                self._refuse_pay(rewards)
                self._obs = obs.to(self.device)
                rewards, dones = rewards.to(self.device), dones.to(self.device)
                self.alg.process_env_step(self._obs, rewards, dones, extras)
                self.logger.process_env_step(rewards, dones, extras)
            self.alg.compute_returns(self._obs)

    def save(self, path: str | None = None, infos: dict[str, Any] | None = None) -> None:
        """Write a checkpoint into the folder, called by its iteration; one process does so.

        Raises:
            ExportError: if the disk does not take it; earlier checkpoints stay.
        """
        state = self.state_dict()  # of all processes: each has to ask for it
        if self.folder is None or not self.first:
            return
        where = Path(path or self.folder / checkpoint_name(self.current_learning_iteration))
        save_checkpoint(where, state | (infos or {}))
        self.logger.save_model(str(where), self.current_learning_iteration)

    def load(
        self,
        path: str | Path,
        load_cfg: dict[str, Any] | None = None,
        strict: bool = True,
        map_location: str | None = None,  # noqa: ARG002
    ) -> dict[str, Any]:
        """Go on from a checkpoint, as if training had not been interrupted.

        With another number of environments only the networks and the curricula go on. From a policy
        without the state of training only the networks do.

        Args:
            path: The checkpoint.
            load_cfg: What to take over, and nothing else: the networks `actor` and `critic`; as far
                as it is in the checkpoint, `optimizer`, and `careers`, where robots are in the
                curriculum. Unless given, all that there is.
            strict: Whether every weight has to be there.
            map_location: Of no use: where the networks are, weights go.

        Raises:
            ConfigError: if it is no checkpoint, or one of another robot, task or map.
        """
        path = Path(path)
        state = read_checkpoint(path)
        refuse_other(path, state, self.env, list(self.env.groups))
        with fitting(path):
            trained = "processes" in state  # and no policy alone
            everything = {"actor": True, "critic": True, "optimizer": True}
            parts = everything if load_cfg is None else load_cfg
            self.alg.load(state, {**parts, "optimizer": trained and parts.get("optimizer")}, strict)
            if trained and load_cfg is None:
                self.current_learning_iteration = state["iteration"]
                self._load_state(state)
            elif trained and parts.get("careers"):
                self.env.careers.load_state_dict(self._own(state)["env"]["careers"])
                self.env.begin_all()
                self._obs = self.env.get_observations().to(self.device)
        return {}

    def state_dict(self) -> dict[str, Any]:
        """Return all that training needs to go on; of every process, if this is the first."""
        mine = {
            "env": self.env.state_dict(),
            "random": _random_state(self.device),
        }
        return {
            "iteration": self.current_learning_iteration,
            "robot": self.env.robot.spec.name,
            "joints": list(self.env.robot.spec.joint_order),
            "observed": widths(self.env),
            **self.alg.save(),
            "processes": self._gathered(mine),
            "curves": self.logger.state_dict(),
        }

    def _load_state(self, state: Mapping[str, Any]) -> None:
        mine = self._own(state)
        self.env.load_state_dict(mine["env"])
        self._obs = self.env.get_observations().to(self.device)
        if len(state["processes"]) == self.gpu_world_size:
            _set_random_state(mine["random"], self.device)
        else:  # or several would go on alike
            self.env.rng = np.random.default_rng([self.env.cfg.runner.seed, state["iteration"]])
        self.logger.load_state_dict(state["curves"])

    def _own(self, state: Mapping[str, Any]) -> Any:
        """Return what this process has in a checkpoint, or that of another for one too many."""
        processes = state["processes"]
        return processes[min(self.gpu_global_rank, len(processes) - 1)]

    def _gathered(self, mine: dict[str, Any]) -> list[Any]:
        """Return what each process has; only in the first one it is more than its own."""
        if not self.is_distributed:
            return [mine]
        everyone: list[Any] | None = [None] * self.gpu_world_size if self.first else None
        torch.distributed.gather_object(mine, everyone, dst=0)
        return everyone or [mine]

    def _asked_to_stop(self) -> bool:
        asked = bool(self.stop())
        if not self.is_distributed:
            return asked
        # One process may have been asked before the others; they have to stop together.
        anyone = torch.tensor(float(asked), device=self.device)
        torch.distributed.all_reduce(anyone, op=torch.distributed.ReduceOp.MAX)
        return bool(anyone)

    def _update(self) -> dict[str, float]:
        """Learn from what was noted, and return the losses."""
        try:
            losses: dict[str, float] = self.alg.update()
        except RuntimeError:  # torch draws no actions from what is not a number
            self._refuse_nonsense()
            raise
        self._refuse_nonsense()
        return losses

    def _refuse_pay(self, rewards: torch.Tensor) -> None:
        """Raise ConfigError if a reward is not a number: a division by zero, as a rule."""
        if not torch.isfinite(rewards).all():
            sums = self.env.sums.items()
            wrong = [name for name, total in sums if not np.isfinite(total).all()]
            raise ConfigError(
                f"rewards are not numbers any more: {listing(wrong) or 'of robots that fell'}"
            )

    def _refuse_nonsense(self) -> None:
        """Raise ConfigError if the networks hold what is not a number: it would only spread."""
        weights = [*self.alg.actor.parameters(), *self.alg.critic.parameters()]
        if not all(torch.isfinite(each).all() for each in weights):
            raise ConfigError(
                f"iteration {self.current_learning_iteration + 1}: the networks have diverged, "
                "their weights are not numbers any more; smaller rewards or a smaller "
                "algorithm.learning_rate may help"
            )

    def _tell(
        self, losses: dict[str, float], collecting: float, learning: float, last: int, pace: float
    ) -> None:
        """Write the curves, and tell whoever watches."""
        done, std = self.current_learning_iteration, self.alg.get_policy().output_std.detach()
        if not self.first:
            return
        self.logger.write(done, collecting, learning, losses, self.alg.learning_rate, std)
        steps = self.cfg["num_steps_per_env"] * self.env.num_envs * self.gpu_world_size
        known, dt = self.logger, self.env.cfg.dt
        self.watch(
            Progress(
                folder=self.folder,
                iteration=done,
                last=last,
                steps_per_second=steps / (collecting + learning),
                learning=learning / (collecting + learning),
                remaining=(last - done) * pace,
                reward=_mean(known.rewbuffer),
                episode_length=_mean([dt * length for length in known.lenbuffer]),
                noise_std=std.mean().item(),
                rewards=known.latest("Episode/rew_"),
                levels=known.latest("Curriculum/level_"),
                success=known.latest("Curriculum/success_"),
            )
        )

    def _configure_multi_gpu(self) -> None:
        """Join the other processes of torchrun: on GPUs rsl-rl's way, on CPUs by gloo."""
        if int(os.environ.get("WORLD_SIZE", "1")) == 1 or self.device != "cpu":
            super()._configure_multi_gpu()
            return
        torch.distributed.init_process_group("gloo")
        self.is_distributed = True
        self.gpu_world_size = torch.distributed.get_world_size()
        self.gpu_global_rank = torch.distributed.get_rank()
        self.gpu_local_rank = int(os.environ.get("LOCAL_RANK", "0"))
        self.cfg["multi_gpu"] = {
            "global_rank": self.gpu_global_rank,
            "local_rank": self.gpu_local_rank,
            "world_size": self.gpu_world_size,
        }


def _mean(values: Any) -> float | None:
    return statistics.mean(values) if values else None


def _random_state(device: str) -> dict[str, torch.Tensor]:
    state = {"cpu": torch.get_rng_state()}
    if device != "cpu":
        state["cuda"] = torch.cuda.get_rng_state(device)
    return state


def _set_random_state(state: Mapping[str, torch.Tensor], device: str) -> None:
    torch.set_rng_state(state["cpu"])
    if device != "cpu" and "cuda" in state:
        torch.cuda.set_rng_state(state["cuda"], device)
