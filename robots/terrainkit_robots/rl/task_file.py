"""Former path of the TOML functions of a task."""

from terrainkit.schema import Config, field_docs, flatten, replace, without_none
from terrainkit_robots.rl.config import Task

NONE = "none"
read_task = Task.load
from_toml = Task.from_toml
to_toml = Config.to_toml
values_of = flatten
told_of = field_docs
changed = replace


def may_be_none(kind: object) -> bool:
    """Return whether an annotation accepts None."""
    return without_none(kind) is not kind
