"""The curves: what rsl-rl writes of training for TensorBoard or wandb, without what it prints."""

import io
import statistics
import threading
from collections.abc import Iterator, Mapping
from contextlib import contextmanager, redirect_stdout, suppress
from pathlib import Path
from typing import Any

import torch
from rsl_rl.utils.logger import Logger

from terrainkit.errors import ConfigError


@contextmanager
def quiet() -> Iterator[None]:
    """Keep rsl-rl from printing."""
    with redirect_stdout(io.StringIO()):
        yield


class Curves(Logger):
    """rsl-rl's logger, which goes on where a checkpoint ends."""

    def __init__(self, **settings: Any) -> None:
        super().__init__(**settings)
        self._means: dict[str, float] = {}
        self._fresh = False

    @contextmanager
    def writing(self, folder: Path | None) -> Iterator[None]:
        """Open the files in a folder, and close them in the end.

        Raises:
            ConfigError: if wandb does not start.
        """
        self.log_dir = None if folder is None else str(folder)
        with quiet():
            try:
                self.init_logging_writer()
            except Exception as error:  # wandb's own: it is asked for only if it is wanted
                if self.cfg["logger"] == "tensorboard":
                    raise
                raise ConfigError(
                    f"wandb does not start: {' '.join(str(error).split())}"
                ) from error
        self._fresh = True
        with _told_once():
            try:
                yield
            except BaseException:
                with suppress(OSError):  # the disk may be full: what was raised says so
                    self._close()
                raise
            self._close()

    def _close(self) -> None:
        if self.writer is not None:
            self.writer.close()
        self.stop_logging_writer()

    def write(
        self,
        iteration: int,
        collecting: float,
        learning: float,
        losses: dict[str, float],
        learning_rate: float,
        std: torch.Tensor,
    ) -> None:
        """Write the curves of an iteration."""
        if self._fresh and self.writer is not None and self.cfg["logger"] == "tensorboard":
            self._begin_at(iteration)
        self._fresh = False
        for key in dict.fromkeys(key for log in self.ep_extras for key in log):
            self._means[key] = statistics.mean(log[key] for log in self.ep_extras if key in log)
        with quiet():
            self.log(
                it=iteration,
                start_it=0,
                total_it=iteration,
                collect_time=collecting,
                learn_time=learning,
                loss_dict=losses,
                learning_rate=learning_rate,
                action_std=std,
                rnd_weight=None,
            )

    def _begin_at(self, iteration: int) -> None:
        """Let TensorBoard forget what a run that broke off wrote after its last checkpoint."""
        from tensorboard.compat.proto.event_pb2 import Event, SessionLog

        start = Event(session_log=SessionLog(status=SessionLog.START))
        self.writer.file_writer.add_event(start, iteration)

    def latest(self, prefix: str) -> dict[str, float]:
        """Return the last known means of what is called `prefix` and more, by the rest of it."""
        found = self._means.items()
        return {key.removeprefix(prefix): mean for key, mean in found if key.startswith(prefix)}

    def state_dict(self) -> dict[str, Any]:
        """Return what the next values of curves depend on."""
        return {
            "rewards": list(self.rewbuffer),
            "lengths": list(self.lenbuffer),
            "reward_sums": self.cur_reward_sum,
            "episode_lengths": self.cur_episode_length,
            "total_steps": self.tot_timesteps,
            "total_time": self.tot_time,
        }

    def load_state_dict(self, state: Mapping[str, Any]) -> None:
        """Go on with the curves; those of other robots' episodes are not gone on with."""
        self.rewbuffer.extend(state["rewards"])
        self.lenbuffer.extend(state["lengths"])
        self.tot_timesteps, self.tot_time = state["total_steps"], state["total_time"]
        if len(state["reward_sums"]) == self.num_envs:
            self.cur_reward_sum.copy_(state["reward_sums"])
            self.cur_episode_length.copy_(state["episode_lengths"])

    def _store_code_state(self) -> list[str]:
        """Leave the user's git alone: `run.toml` says which versions were used."""
        return []


@contextmanager
def _told_once() -> Iterator[None]:
    """Keep TensorBoard's thread from printing why it ends: the next curve raises it again."""
    before = threading.excepthook
    threading.excepthook = lambda told: None if told.exc_type is OSError else before(told)
    try:
        yield
    finally:
        threading.excepthook = before
