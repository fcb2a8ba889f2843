"""Check a task: find its host, roll out the behaviors, and run the rules."""

from dataclasses import replace
from pathlib import Path
from typing import Literal

from terrainkit.errors import ConfigError, TerrainkitError, plugin_errors
from terrainkit_robots.lint.check import select_rules
from terrainkit_robots.lint.runner import Report, lint
from terrainkit_robots.lint.settings import Settings
from terrainkit_robots.task_check.behaviors import measure_task
from terrainkit_robots.task_check.host import Host, Progress

HostName = Literal["terrainkit", "gymnasium", "mjlab"]


def host_name(task: str) -> HostName:
    """Return the framework of a task by its name: an id with a version (`-v5`) is Gymnasium's."""
    if "Mjlab-" in task:
        return "mjlab"
    return "gymnasium" if task.rpartition("-v")[2].isdecimal() else "terrainkit"


def open_host(
    task: str, host: HostName, task_file: Path | None = None, terrain: str | None = None
) -> Host:
    """Return the environment of a task.

    Args:
        task: Name of a task of ours, folder of a robot or of a run, id of Gymnasium, or name of a
            task of mjlab; empty for the task of the file.
        host: Framework.
        task_file: Python file with a task of ours, which is executed.
        terrain: For a task of ours: `plane`, a map, or the config of a map; by default, the terrain
            of the run, or a plane.

    Raises:
        ConfigError: If there is no such task.
        PluginError: If the environment of another framework fails.
    """
    if host != "terrainkit" and (task_file or terrain):
        raise ConfigError(f"--task, --terrain: got a value for {host}; expected none")
    if host == "gymnasium":
        from terrainkit_robots.task_check.hosts.gymnasium_host import GymnasiumHost

        with plugin_errors(task, TerrainkitError):
            return GymnasiumHost(task)
    if host == "mjlab":
        from terrainkit_robots.task_check.hosts.mjlab_host import MjlabHost, load_cfg

        with plugin_errors(task, TerrainkitError):
            return MjlabHost(task, load_cfg(task))
    return _open_own(task, task_file, terrain)


def _open_own(name: str, task_file: Path | None, terrain: str | None) -> Host:
    """Return the environment of a task of ours."""
    from terrainkit_robots.rl.run import RUN_FILE, PolicySpec, open_run
    from terrainkit_robots.rl.tasks import get_task, load_task_file
    from terrainkit_robots.rl.terrain import load_terrain
    from terrainkit_robots.spec.robot_arrays import Robot
    from terrainkit_robots.task_check.hosts.terrainkit_host import TerrainkitHost

    own = load_task_file(str(task_file)) if task_file else None
    if (Path(name) / RUN_FILE).is_file():
        spec: PolicySpec = open_run(name, task_file=task_file)
    else:
        found = own if own and not name else get_task(name)
        spec = PolicySpec(task=found.task, robot=Robot.load(found.folder))
    ground = load_terrain(terrain or spec.terrain, spec.task.terrain.collision)
    return TerrainkitHost(spec, ground, task_file or Path(name))


def check_task(
    host: Host,
    settings: Settings | None = None,
    progress: Progress = lambda _: None,
    samples: int | None = None,
) -> Report:
    """Return what the rules find in a task.

    Args:
        host: Its environment.
        settings: Selected and ignored rules.
        progress: Called with a text at each behavior and each iteration of the training.
        samples: Samples of a short training; None for none. A host without a training takes none.

    Returns:
        The report. Its `facts` are the `TaskFacts`; rules that the host does not support are
        skipped, with the reason.

    Raises:
        ConfigError: If the host has no training.
        PluginError: If the environment of another framework fails.
    """
    selected, ignored = select_rules(settings or Settings(), "task")
    foreign = str(host.file) if host.name != "terrainkit" else None
    with plugin_errors(foreign, TerrainkitError):
        facts = measure_task(host, progress, samples)
    report = lint(facts, selected)
    return replace(report, skipped=(*report.skipped, *ignored))
