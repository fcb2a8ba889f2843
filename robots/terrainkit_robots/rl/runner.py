"""The runner: rsl-rl's `OnPolicyRunner` with exact resume, graceful stopping and progress."""

import os
import sys
import threading
from collections.abc import Callable, Mapping
from contextlib import AbstractContextManager, nullcontext, redirect_stdout, suppress
from dataclasses import replace
from pathlib import Path
from typing import Any, cast

os.environ.setdefault("GIT_PYTHON_REFRESH", "quiet")  # rsl-rl imports git, which may be missing

import numpy as np
import torch
from rsl_rl.runners import OnPolicyRunner
from rsl_rl.utils.logger import Logger

from terrainkit.errors import ConfigError, TerrainkitError, listing, plugin_errors
from terrainkit_robots.checkpoint import (
    TRAINING_KEYS,
    check_state,
    open_checkpoint,
    save_checkpoint,
)
from terrainkit_robots.rl.config import Task
from terrainkit_robots.rl.env import LeggedEnv
from terrainkit_robots.rl.env_state import env_state, load_env_state
from terrainkit_robots.rl.estimator import FORCED_ITERATIONS, EstimatorModel, estimator_update
from terrainkit_robots.rl.symmetry import augment, has_symmetry, mirrored_update

_NETWORKS = "actor", "critic", "student", "teacher", "rnd"
"""Names of networks that an algorithm of rsl-rl may have."""

_NOISE = "distribution."
"""Prefix of the parameters of the noise of the actions in the state of an actor."""

_TABLES = "actor", "critic", "student", "teacher", "algorithm", "obs_groups"
"""Tables of rsl-rl's configuration that `runner.rsl_rl` may change; settings have the others."""


class MetricsLogger(Logger):
    """rsl-rl's logger without console output."""

    writer: Any

    def __init__(self, runner: "LeggedRunner") -> None:
        self._runner = runner
        env = runner.env
        self.episode_callback: Callable[[int, Mapping[str, float]], object] = lambda *_: None
        """Called with the number of episodes that a step ended, and the means of their log."""
        world = (runner.is_distributed, runner.gpu_world_size, runner.gpu_global_rank)
        super().__init__(None, runner.cfg, env.cfg, env.num_envs, *world, runner.device)
        self.tot_time = 0.0

    def init_logging_writer(self) -> None:
        """Open the log files."""
        is_wandb = self._runner.env.cfg.runner.logger == "wandb"
        if not is_wandb:
            # TensorBoard drops what an interrupted run logged after its last checkpoint.
            self.cfg["logger"]["purge_step"] = self._runner.current_learning_iteration
        with redirect_stdout(None), plugin_errors("wandb does not start" if is_wandb else None):
            super().init_logging_writer()

    def stop_logging_writer(self) -> None:
        """Close the log files, if they are open."""
        if self.writer is not None:
            self.writer.close()
            super().stop_logging_writer()
            self.writer = None

    def process_env_step(
        self, rewards: torch.Tensor, dones: torch.Tensor, extras: Any, *args: Any, **kwargs: Any
    ) -> None:
        """Check and record the rewards of a step."""
        if not torch.isfinite(rewards).all():
            sums = self._runner.env.episode_sums.items()
            names = [name for name, total in sums if not np.isfinite(total).all()]
            raise ConfigError(f"rewards are not finite: {listing(names) or 'of robots that fell'}")
        super().process_env_step(rewards, dones, extras, *args, **kwargs)
        if "log" in extras:
            self.episode_callback(int(dones.sum()), extras["log"])

    def log(self, **values: Any) -> None:
        """Log an iteration, save a checkpoint if one is due, and end training by raising `_Stop`.

        rsl-rl calls this after each update.
        """
        self._runner.check_weights()
        with redirect_stdout(None):
            super().log(**values)
        self._runner.finish_iteration(values["it"], values["collect_time"], values["learn_time"])

    def continue_from(self, state: Mapping[str, Any]) -> None:
        """Continue the curves of a run; the means begin with the episodes that are running.

        Args:
            state: Steps of all robots, and time of the training [s], as `totals` returns them.
        """
        check_state("logger", state, self.totals())
        self.tot_timesteps, self.tot_time = state["tot_timesteps"], state["tot_time"]
        env = self._runner.env
        self.cur_reward_sum[:] = torch.from_numpy(np.sum([*env.episode_sums.values()], axis=0))
        self.cur_episode_length[:] = torch.from_numpy(env.steps_since_reset)

    def totals(self) -> dict[str, Any]:
        """Return steps and time since the start of the training, for a checkpoint."""
        return {"tot_timesteps": self.tot_timesteps, "tot_time": self.tot_time}

    def _store_code_state(self) -> list[str]:
        return []  # a run.toml records the versions; the user's git repository is not touched


class _Stop(Exception):  # noqa: N818
    """Leaves rsl-rl's loop after an iteration."""


class LeggedRunner(OnPolicyRunner):
    """Train a policy with PPO. Iteration k is the state after k updates."""

    env: LeggedEnv
    logger: MetricsLogger
    is_distributed: bool
    gpu_global_rank: int
    gpu_world_size: int
    current_learning_iteration: int

    last_iteration: int
    """The iteration after which training ends."""

    collect_time: float
    """Time of the steps of the last iteration [s]."""

    learn_time: float
    """Time of the update of the last iteration [s]."""

    def __init__(
        self,
        env: LeggedEnv,
        folder: Path | None = None,
        device: str = "cpu",
        *,
        progress_callback: "Callable[[LeggedRunner], object] | None" = None,
        should_stop: Callable[[], object] = lambda: False,
    ) -> None:
        """Create the networks; without a `folder`, no checkpoints and logs are written.

        `progress_callback` is called after each iteration with the runner, and `should_stop` before
        each one: True stops training with a checkpoint.
        """
        self.env, self.folder = env, folder
        self._progress_callback, self._should_stop = progress_callback, should_stop
        with redirect_stdout(None), self._rsl_rl_errors():
            super().__init__(env, runner_config(env.cfg, has_symmetry(env)), None, device)
        self.is_main_process = self.gpu_global_rank == 0
        self.logger = MetricsLogger(self)
        symmetry = getattr(self.alg, "symmetry", None)
        if symmetry:
            self.alg.update = mirrored_update(env, self.alg)
            if not symmetry.use_mirror_loss:
                # rsl-rl runs the actor once more in each mini-batch, only to log this loss.
                symmetry.compute_loss = lambda *_: torch.zeros(())
        if isinstance(getattr(self.alg, "actor", None), EstimatorModel):
            mirrored = symmetry and symmetry.use_data_augmentation
            self.alg.update = estimator_update(
                self.alg,
                lambda obs: augment(env, obs, None)[0] if mirrored else obs,
                min(FORCED_ITERATIONS, env.cfg.runner.max_iterations // 2),
            )

    def learn(self, num_learning_iterations: int, init_at_random_ep_len: bool = False) -> None:
        """Train for some iterations, with the first episodes cut to random lengths if requested."""
        self._completed = self.current_learning_iteration
        self.last_iteration = self._completed + num_learning_iterations
        self.logger.log_dir = None if self.folder is None else str(self.folder)
        if self._stop_requested():
            self.save()
            return
        self.current_learning_iteration += 1  # rsl-rl's first iteration has the number 0
        # TensorBoard's thread prints an OSError, which the next log call raises again.
        hook = threading.excepthook
        threading.excepthook = lambda args: (
            None if issubclass(args.exc_type, OSError) else hook(args)
        )
        try:
            quiet = redirect_stdout(None) if self.is_distributed else nullcontext()
            with quiet, suppress(_Stop), self._rsl_rl_errors():
                super().learn(num_learning_iterations, init_at_random_ep_len)
        except RuntimeError as error:  # torch cannot sample from weights that are not finite
            self.check_weights()
            if not self.is_distributed:
                raise
            self._continue_alone(error)
        finally:
            with suppress(OSError):  # on a full disk, the first error says so
                self.logger.stop_logging_writer()
            threading.excepthook = hook

    def _rsl_rl_errors(self) -> AbstractContextManager[None]:
        """Replace errors of the classes and settings in `runner.rsl_rl` by a PluginError."""
        plugin = "runner.rsl_rl" if self.env.cfg.runner.rsl_rl else None
        return plugin_errors(plugin, TerrainkitError, OSError, RuntimeError, _Stop)

    def finish_iteration(self, iteration: int, collect_time: float, learn_time: float) -> None:
        """Report the progress, write a checkpoint if one is due, and stop if requested."""
        self._limit_noise(iteration)
        self._completed, self.collect_time, self.learn_time = iteration, collect_time, learn_time
        if self.is_main_process and self._progress_callback is not None:
            self._progress_callback(self)
        stop = iteration == self.last_iteration or self._stop_requested()
        if stop or iteration % self.env.cfg.runner.save_interval == 0:
            self.save()
        if stop:
            raise _Stop

    def _limit_noise(self, iteration: int) -> None:
        """Limit the standard deviation of the actions as `policy.final_noise_std` says."""
        policy = self.env.cfg.policy
        if policy.final_noise_std is None:
            return
        noise = getattr(self.alg.get_policy().distribution, "std_param", None)
        if noise is None:
            expected = "expected none for a network without `std_param`"
            raise ConfigError(f"policy.final_noise_std: got {policy.final_noise_std:g}; {expected}")
        quarters = 4 * iteration / self.env.cfg.runner.max_iterations
        if quarters <= 2:
            return
        limit = np.interp(quarters, [2, 3], [policy.init_noise_std, policy.final_noise_std])
        noise.data.clamp_(max=float(limit))

    def _continue_alone(self, error: RuntimeError) -> None:
        """Save a checkpoint after another process of torchrun has ended, and stop.

        Raises:
            ConfigError: In the main process.
        """
        if not self.is_main_process:
            raise SystemExit(1) from error
        self.is_distributed = False
        self.current_learning_iteration = self._completed
        self.save()
        raise ConfigError(
            f"another process of torchrun ended after iteration {self._completed}; continue with "
            f"--resume {self.folder}"
        ) from error

    def save(self, path: str | Path | None = None, infos: dict[str, Any] | None = None) -> None:
        """Write a checkpoint, by default to the folder; every process must call this."""
        state = self.state_dict() | (infos or {})
        if path is None and self.folder is not None:
            path = self.folder / f"model_{self.current_learning_iteration}.pt"
        if path is not None and self.is_main_process:
            save_checkpoint(Path(path), state)
            self.logger.save_model(str(path), self.current_learning_iteration)

    def load(
        self,
        path: str | Path,
        load_cfg: dict[str, Any] | None = None,
        strict: bool = True,
        map_location: str | None = None,  # noqa: ARG002
    ) -> dict[str, Any]:
        """Load a checkpoint.

        By default training continues exactly; with another number of environments, only the
        networks, the optimizer and the curriculum do. A checkpoint of a policy alone has only
        networks.
        `load_cfg` selects parts: `actor`, `critic`, `optimizer`, `curriculum` (terrain levels), and
        `noise_std`, the standard deviation of the actions.
        """
        own = self._algorithm_state()
        # These networks walk forward already. A run that continues loads its own number of steps.
        self.env.velocity_command.steps[:] = self.env.cfg.commands.forward_steps
        if "teacher_state_dict" in own and load_cfg is not None:
            self._load_teacher(Path(path))
            return {}
        parts = load_cfg or {name.removesuffix("_state_dict"): True for name in own}
        joints = self.env.robot.spec.joint_order
        with open_checkpoint(Path(path), joints, self.env.obs_sizes) as state:
            if not parts.get("noise_std", True):
                noise = {k: v for k, v in own["actor_state_dict"].items() if k.startswith(_NOISE)}
                state["actor_state_dict"] = {**state["actor_state_dict"], **noise}
            state["student_state_dict"] = state["actor_state_dict"]
            for name in own.keys() & {f"{part}_state_dict" for part in _NETWORKS if part in parts}:
                check_state(name, state[name], own[name])
            if not TRAINING_KEYS & state.keys():
                self.alg.load(state, {**parts, "optimizer": False}, strict)
                return {}
            process = {"env": ..., "random": {"cpu": torch.get_rng_state()}}
            adam = {"state": ..., "param_groups": [{"lr": 0.0}]}
            training = {"optimizer_state_dict": adam, "logger": {}, "processes": [process]}
            check_state("state", state, training)
            if not state["processes"]:
                raise ConfigError("state.processes: got none; expected one or more")
            optimizer = self._optimizer_state(state) if parts.get("optimizer") else {}
            self.alg.load(
                state | {"optimizer_state_dict": optimizer},
                {**parts, "student": parts.get("actor")},
                strict,
            )
            processes = state["processes"]  # additional processes use the last state
            process = processes[min(self.gpu_global_rank, len(processes) - 1)]
            if load_cfg is not None:
                if load_cfg.get("curriculum"):
                    self.env.curriculum.load_state_dict(process["env"]["curriculum"])
                    self.env.reset()
                return {}
            self.current_learning_iteration = state["iteration"]
            load_env_state(self.env, process["env"])
            self.logger.continue_from(state["logger"])
            if len(processes) != self.gpu_world_size:  # no two processes may sample alike
                self.env.rng = np.random.default_rng([self.env.cfg.runner.seed, state["iteration"]])
            else:
                torch.set_rng_state(process["random"]["cpu"])
                if self.device != "cpu" and "cuda" in process["random"]:
                    torch.cuda.set_rng_state(process["random"]["cuda"], self.device)
        return {}

    def _load_teacher(self, path: Path) -> None:
        """Load the actor of a checkpoint as the teacher of a distillation."""
        groups = self.cfg["obs_groups"]["teacher"]
        algorithm = cast("Any", self.alg)
        sizes = {"policy": sum(self.env.obs_sizes[name] for name in groups)}
        with open_checkpoint(path, self.env.robot.spec.joint_order, sizes) as state:
            weights = state["actor_state_dict"]
            check_state("actor_state_dict", weights, algorithm.teacher.state_dict())
            algorithm.load({"teacher_state_dict": weights}, {"teacher": True}, strict=True)

    def state_dict(self) -> dict[str, Any]:
        """Return everything for an exact resume; of all processes, in the main process."""
        process = {"env": env_state(self.env), "random": {"cpu": torch.get_rng_state()}}
        if self.device != "cpu":
            process["random"]["cuda"] = torch.cuda.get_rng_state(self.device)
        processes: list[Any] = [process]
        if self.is_distributed:
            processes *= self.gpu_world_size
            target = processes if self.is_main_process else None
            torch.distributed.gather_object(process, target, dst=0)
        return {
            "iteration": self.current_learning_iteration,
            "robot": self.env.robot.spec.name,
            "joints": list(self.env.robot.spec.joint_order),
            "observed": self.env.obs_sizes,
            **self._algorithm_state(),
            "processes": processes,
            "logger": self.logger.totals(),
        }

    def _algorithm_state(self) -> dict[str, Any]:
        """Return the state of the algorithm, in which a student is the actor."""
        state = self.alg.save()
        if "student_state_dict" in state:
            state |= {"actor_state_dict": state.pop("student_state_dict"), "critic_state_dict": {}}
        return state

    def _optimizer_state(self, state: Mapping[str, Any]) -> dict[str, Any]:
        """Return what the optimizer loads from a checkpoint: the moments and the learning rate.

        The other settings come from the task.
        """
        saved = state["optimizer_state_dict"]
        optimizer = self.alg.optimizer
        groups = optimizer.state_dict()["param_groups"]
        weights = enumerate(
            weight for group in optimizer.param_groups for weight in group["params"]
        )
        step = torch.tensor(0.0)
        moments = {
            k: {"step": step, "exp_avg": weight, "exp_avg_sq": weight} for k, weight in weights
        }
        is_new = not state["iteration"] and saved["state"] == {}  # before the first update
        check_state("optimizer_state_dict.state", saved["state"], {} if is_new else moments)
        rates = [{"lr": group["lr"]} for group in saved["param_groups"]]
        new = [group | rate for group, rate in zip(groups, rates, strict=True)]
        return {"state": saved["state"], "param_groups": new}

    def _stop_requested(self) -> bool:
        requested = torch.tensor(float(bool(self._should_stop())), device=self.device)
        if self.is_distributed:  # a signal may reach one process first; all stop together
            torch.distributed.all_reduce(requested, op=torch.distributed.ReduceOp.MAX)
        return bool(requested)

    def check_weights(self) -> None:
        """Raise ConfigError if a weight of the networks is not finite."""
        networks = (getattr(self.alg, name, None) for name in _NETWORKS)
        weights = (weight for network in networks if network for weight in network.parameters())
        if not all(torch.isfinite(weight).all() for weight in weights):
            raise ConfigError(
                f"iteration {self._completed + 1}: the networks have diverged, their weights are "
                "not finite; smaller rewards or a smaller algorithm.learning_rate may help"
            )

    def _configure_multi_gpu(self) -> None:
        """Join torchrun's other processes; on CPUs with gloo, which rsl-rl does not support."""
        if self.device != "cpu" or os.environ.get("WORLD_SIZE", "1") == "1":
            super()._configure_multi_gpu()
            return
        torch.distributed.init_process_group("gloo")
        rank, count = torch.distributed.get_rank(), torch.distributed.get_world_size()
        self.is_distributed, self.gpu_global_rank, self.gpu_world_size = True, rank, count
        self.cfg["multi_gpu"] = {"global_rank": rank, "world_size": count}


def runner_config(task: Task, is_symmetric: bool = True) -> dict[str, Any]:
    """Return the configuration of rsl-rl's runner.

    Raises:
        ConfigError: If `runner.rsl_rl` names a class outside of rsl-rl and the task's module.
    """
    policy, runner, algorithm = task.policy, task.runner, dict(vars(task.algorithm))
    changes, symmetry = runner.rsl_rl, algorithm.pop("symmetry")
    if unknown := [name for name in changes if name not in _TABLES]:
        raise ConfigError(f"runner.rsl_rl: got {unknown[0]}; expected one of: {listing(_TABLES)}")
    _check_names(changes, type(task).__module__)
    if symmetry is None:  # rsl-rl rejects it for distillation and recurrent networks
        networks = (changes.get(name, {}) for name in ("actor", "critic"))
        is_recurrent = any("rnn_type" in network for network in networks)
        symmetry = is_symmetric and "student" not in changes and not is_recurrent
    augmentation = {
        "data_augmentation_func": "terrainkit_robots.rl.symmetry:augment",
        "use_data_augmentation": True,
    }
    loggers = {
        "tensorboard": {"class_name": "torch.utils.tensorboard:SummaryWriter", "flush_secs": 10},
        "wandb": {"class_name": "WandbLogWriter", "project_name": "terrainkit"},
    }
    network: dict[str, Any] = {"class_name": "MLPModel", "activation": policy.activation}
    network |= {"obs_normalization": policy.obs_normalization}
    distribution = {"class_name": "GaussianDistribution", "init_std": policy.init_noise_std}
    actor = {"hidden_dims": list(policy.actor_hidden_dims), "distribution_cfg": distribution}
    if task.has_estimator:
        actor["class_name"] = "terrainkit_robots.rl.estimator:EstimatorModel"
        actor["estimator_hidden_dims"] = list(policy.estimator_hidden_dims or ())
    config = {
        "num_steps_per_env": runner.num_steps_per_env,
        "save_interval": sys.maxsize,  # `LeggedRunner.finish_iteration` saves, in all processes
        "seed": runner.seed,
        "logger": loggers[runner.logger],
        "check_for_nan": False,  # `MetricsLogger` names the rewards that are not finite
        "obs_groups": {"actor": ["policy"], "critic": ["privileged"]},
        "actor": network | actor,
        "critic": network | {"hidden_dims": list(policy.critic_hidden_dims)},
        "algorithm": {"class_name": "PPO", **algorithm, "rnd_cfg": None}
        | {"symmetry_cfg": augmentation if symmetry else None},
    }
    if "student" in changes:
        config |= {"student": network | actor, "teacher": network | actor}
    return _merged(config, changes)


def _merged(config: Mapping[str, Any], changes: Mapping[str, Any]) -> dict[str, Any]:
    """Return nested tables with other values."""
    tables = {name: value for name, value in changes.items() if isinstance(value, Mapping)}
    merged = {name: _merged(config.get(name) or {}, table) for name, table in tables.items()}
    return {**config, **changes, **merged}


def _check_names(value: Any, module: str, key: str = "runner.rsl_rl") -> None:
    """Check that the classes in a table belong to rsl-rl or to the module of the task.

    rsl-rl imports a name with a module, and calls what it finds. A run may be from a stranger.

    Raises:
        ConfigError: if a name belongs to another module.
    """
    if isinstance(value, Mapping):
        for name, item in value.items():
            _check_names(item, module, f"{key}.{name}")
    elif isinstance(value, str) and not value.removeprefix(f"{module}:").isidentifier():
        expected = f"a class of rsl-rl, such as RNNModel, or {module}:CLASS"
        raise ConfigError(f"{key}: got {value!r}; expected {expected}")


def resolve_device(name: str) -> str:
    """Return the device `name`: `cpu`, `cuda` or `cuda:1`; under torchrun, this process's GPU.

    Args:
        name: `cpu`, `cuda`, or a GPU such as `cuda:1`.

    Returns:
        Name of the device. Under torchrun, the GPU of this process.

    Raises:
        ConfigError: If there is no such device.
    """
    gpus = [f"cuda:{k}" for k in range(torch.cuda.device_count())]
    if name in ("cpu", "cpu:0"):
        return "cpu"
    if name not in gpus and not (gpus and name == "cuda"):
        raise ConfigError(f"device: got {name!r}; expected one of: {listing(['cpu', *gpus])}")
    return f"cuda:{os.environ['LOCAL_RANK']}" if "LOCAL_RANK" in os.environ else name


def available_processors() -> int:
    """Return the number of processors that this process may use."""
    return len(getattr(os, "sched_getaffinity", lambda _: range(os.cpu_count() or 1))(0))


def process_share(task: Task) -> Task:
    """Return the task of this process: under torchrun, its share of the environments.

    Raises:
        ConfigError: If there are fewer environments than processes.
    """
    rank, count = int(os.environ.get("RANK", "0")), int(os.environ.get("WORLD_SIZE", "1"))
    num_envs, local_count = task.env.num_envs, int(os.environ.get("LOCAL_WORLD_SIZE", "1"))
    if num_envs < count:
        expected = f"expected one for each of {count} processes"
        raise ConfigError(f"env.num_envs: got {num_envs}; {expected}")
    threads = task.env.num_threads or max(1, available_processors() // local_count)
    num_envs = num_envs // count + (rank < num_envs % count)
    env = replace(task.env, num_envs=num_envs, num_threads=threads)
    return replace(task, env=env, runner=replace(task.runner, seed=task.runner.seed + rank))
