"""Former path of rl/tasks.py."""

from terrainkit_robots.rl.tasks import ENTRY_POINTS, TaskSpec, _registered
from terrainkit_robots.rl.tasks import TRAINED_FOLDER as SHIPPED
from terrainkit_robots.rl.tasks import get_task as find
from terrainkit_robots.rl.tasks import register_task as register
from terrainkit_robots.rl.tasks import task_names as names

Registered = TaskSpec

__all__ = ["ENTRY_POINTS", "SHIPPED", "Registered", "_registered", "find", "names", "register"]
