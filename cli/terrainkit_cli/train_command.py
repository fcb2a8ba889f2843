"""The command that trains a policy."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from importlib.util import find_spec
from os.path import isdir
from pathlib import Path
from shlex import quote
from typing import TYPE_CHECKING, Annotated, ClassVar

from terrainkit.errors import ConfigError, listing
from terrainkit_cli import render
from terrainkit_cli.argument_types import Device, TaskFile, TerrainName
from terrainkit_cli.config_options import ConfigCommand
from terrainkit_cli.parse import is_option, option, positional
from terrainkit_cli.plugin_command import PluginCommand
from terrainkit_cli.signals import stop_on_signals
from terrainkit_cli.training_extra import require_training
from terrainkit_cli.training_progress import ProgressMeter, shown_progress

if TYPE_CHECKING:
    from terrainkit_robots.rl.config import Task
    from terrainkit_robots.rl.runner import LeggedRunner


@dataclass(frozen=True, kw_only=True)
class Train(PluginCommand, ConfigCommand):
    """Train a policy for a robot on a terrain, and save it as a run.

    A run is a folder with the task, checkpoints (model_100.pt is written after 100 iterations) and
    TensorBoard logs. Ctrl-C writes a checkpoint and stops. Training is deterministic: the same seed
    and number of threads give the same policy. With torchrun, the environments are divided among
    the processes.

    The options in the groups below set the values of the task. Their defaults come from ROBOT,
    --resume and --config.
    """

    ALIASES: ClassVar[Mapping[str, str]] = {
        "env.num_envs": "--num-envs",
        "runner.max_iterations": "--max-iterations",
        "runner.seed": "--seed",
    }

    robot: Annotated[str, positional("ROBOT")] = ""
    """Name of a bundled task, or a folder written by terrainkit onboard."""

    task: TaskFile | None = None
    """In place of ROBOT: a Python file with a task of your own, which is executed."""

    config: Annotated[str, option("PATH")] = ""
    """Task file (.toml) whose values override the robot's task; options override both."""

    terrain: TerrainName = ""
    """plane (the default), a map (.npz), or a map config (.toml)."""

    log_dir: Annotated[Path, option("FOLDER")] | None = None
    """Folder of the run, new or empty; by default logs/ROBOT/DATE-TIME."""

    resume: Annotated[str, option("RUN")] = ""
    """Continue a run: its folder, or one of its checkpoints. Without ROBOT, robot and task are the
    run's own; without --terrain, the terrain. Training continues in the same folder, as if it had
    not been interrupted. With another terrain or task, a new run starts with the networks of this
    run. It also starts with its optimizer state if --algorithm.learning-rate and
    --algorithm.schedule are the same, with its terrain levels if the map is the same, and with the
    noise of its actions if --policy.init-noise-std is the same."""

    device: Device = "cpu"
    """Device of the networks: cpu, cuda, cuda:1. The physics runs on the CPU."""

    @classmethod
    def default_config(cls) -> "Task":
        """Return the default task."""
        from terrainkit_robots.rl.config import Task

        return Task()

    @classmethod
    def load_config(cls, argv: Sequence[str]) -> "Task":
        """Return the task before options: the task of the run or the robot, then --config."""
        given, rest = cls.split(argv)
        from terrainkit_robots.rl.tasks import get_task, load_task_file

        if path := given.get("task"):
            task = load_task_file(path).task
        elif (resume := given.get("resume")) and not _known_task(rest):
            from terrainkit_robots.rl.run import open_run

            task = open_run(resume).task
        else:
            task = get_task(_task_word(rest)).task
        path = given.get("config")
        return type(task).load(path, task) if path else task

    def run(self) -> int:
        """Train, and print the next commands."""
        require_training()
        from terrainkit_robots.rl.run import open_run
        from terrainkit_robots.rl.tasks import load_task_file
        from terrainkit_robots.rl.train import train

        run = open_run(self.resume) if self.resume else None
        if self.task and self.robot:
            raise ConfigError("ROBOT, --task: got both; expected one of them")
        own = load_task_file(str(self.task)).name if self.task else self.robot
        robot = own or (run.info.robot if run else "")
        terrain = self.terrain or (run.terrain if run else "plane")
        task = self.changed_config()
        if task.runner.logger == "wandb" and find_spec("wandb") is None:
            raise ConfigError("runner.logger: wandb is not installed: pip install wandb")
        with stop_on_signals() as stop_signal, shown_progress() as show:
            meter = ProgressMeter(show)

            def start(runner: "LeggedRunner") -> None:
                _print_start(runner, terrain)
                meter.start(runner)

            runner = train(
                robot,
                terrain,
                task,
                folder=self.log_dir,
                resume=run,
                device=self.device,
                start_callback=start,
                progress_callback=meter.update,
                should_stop=stop_signal,
            )
            completed = runner.current_learning_iteration
            signal_number = stop_signal() if completed < task.runner.max_iterations else 0
        _print_result(runner, task, self.task)
        return 128 + signal_number if signal_number else 0


def _known_task(argv: Sequence[str]) -> str:
    """Return the first word that names a task or a folder, empty if there is none."""
    from terrainkit_robots.rl.tasks import task_names

    names = task_names()
    # Path.is_dir raises OSError for long names.
    return next((word for word in argv if word in names or isdir(word)), "")  # noqa: PTH112


def _task_word(argv: Sequence[str]) -> str:
    """Return ROBOT among words.

    An option that only the task of ROBOT has may precede it. How many of the words in between are
    values of that option is unknown until then.

    Raises:
        ConfigError: if there is none.
    """
    from terrainkit_robots.rl.tasks import task_names

    if known := _known_task(argv):
        return known
    if argv and argv[0] and not is_option(argv[0]):
        return argv[0]
    raise ConfigError(
        "ROBOT: missing; expected a folder written by terrainkit onboard, or one of: "
        f"{listing(task_names())}"
    )


def _print_start(runner: "LeggedRunner", terrain: str) -> None:
    """Print at once what is trained, where, and with how many threads."""
    from terrainkit_robots.text import count, display_path

    env = runner.env.cfg.env
    where = f"{runner.env.robot.spec.name} on {display_path(terrain)}"
    parallel = f"{count(env.num_envs, 'robot')}, {count(env.num_threads, 'thread')}"
    render.note(f"training {where}: {parallel}, in {runner.folder}")


def _print_result(runner: "LeggedRunner", task: "Task", task_file: Path | None) -> None:
    """Print the result and the next commands."""
    if runner.folder is None:  # only the first of several processes prints
        return
    from terrainkit_robots.text import count

    folder = quote(str(runner.folder))
    completed = runner.current_learning_iteration
    run = f"{folder} --task {quote(str(task_file))}" if task_file else folder
    whole = task.runner.max_iterations
    if completed < whole:
        render.result(f"stopped after {completed} of {whole} iterations: {folder}")
        render.result(f"continue: terrainkit train --resume {run}")
        return
    render.result(f"trained {count(whole, 'iteration')}: {folder}")
    average = ""
    if whole >= 7 * task.runner.save_interval:  # `average` takes 7 checkpoints by default
        average = f"      terrainkit average {run} -o {folder}_mean  (mean of checkpoints)\n"
    render.result(
        f"next: terrainkit play {run}  (record a video)\n"
        f"      terrainkit evaluate {run}  (measure it)\n{average}"
        f"      terrainkit export {run}  (ONNX, TorchScript)\n"
        f"      tensorboard --logdir {folder}  (learning curves)"
    )
