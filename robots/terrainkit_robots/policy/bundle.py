"""The shipping: of a run, what a robot needs that comes with a policy.

What is left is small, names no folder of the machine that it was trained on, and is opened like any
run: by the name of its task, once it is where :attr:`~.registry.Registered.shipped` says.
"""

from pathlib import Path

import tomli_w

from terrainkit.errors import ConfigError, listing
from terrainkit.toml_text import parse_toml
from terrainkit_robots.onboarding.folder import new_folder
from terrainkit_robots.rl import registry
from terrainkit_robots.rl.run import (
    MAP_FILE,
    RUN_FILE,
    TASK_FILE,
    Run,
    checkpoint_name,
    open_run,
    policy_state,
    read_checkpoint,
    save_checkpoint,
)
from terrainkit_robots.rl.scene import SPEC_FILE


def ship(run: Run, folder: Path | str) -> Run:
    """Write what is shipped of a run: its files, and one checkpoint with the networks alone.

    Args:
        run: A run on a plane or on a map, of a robot that is registered.
        folder: Where; the task's `shipped`, for a policy that is found by its name.
            Folders above it are made.

    Returns:
        The run that was written.

    Raises:
        ConfigError: if the run has no checkpoint, or its robot or ground is found on this machine
            alone.
        ExportError: if the folder holds something, or cannot be written.
    """
    folder = Path(folder)
    if run.checkpoint is None:
        raise ConfigError(f"{run.folder} has no checkpoint yet; wanted a run that has been trained")
    if run.robot_name not in registry.names():
        raise ConfigError(
            f"{run.folder} is of the robot in {run.robot_name}; wanted one that is registered: "
            f"{listing(registry.names())}"
        )
    noted = [TASK_FILE, SPEC_FILE] + [MAP_FILE] * (run.terrain != "plane")
    if not (run.folder / noted[-1]).is_file():
        raise ConfigError(
            f"{run.folder} is on {run.terrain}, which is no map that can be made again"
        )
    about = parse_toml((run.folder / RUN_FILE).read_text(encoding="utf-8"))
    about["terrain"] = "plane" if run.terrain == "plane" else MAP_FILE
    state = policy_state(read_checkpoint(run.checkpoint))
    folder.parent.mkdir(parents=True, exist_ok=True)
    with new_folder(folder) as made:
        for name in noted:
            (made / name).write_bytes((run.folder / name).read_bytes())
        (made / RUN_FILE).write_text(tomli_w.dumps(about), encoding="utf-8")
        save_checkpoint(made / checkpoint_name(state["iteration"]), state)
    return open_run(folder)
