"""Plugin files: Python files with terrains and overlays of your own, which --plugin names."""

import inspect
import sys
from importlib.util import module_from_spec, spec_from_file_location
from os.path import isfile
from pathlib import Path

from terrainkit.errors import ConfigError, is_built_in, plugin_errors
from terrainkit.terrain import Terrain
from terrainkit.terrain.overlay import Overlay
from terrainkit.terrain.registry import register_overlay, register_terrain

_loaded: dict[str, Path] = {}
"""The files that this process has imported, by the name of their modules."""


def plugin_files() -> tuple[Path, ...]:
    """Return the plugin files that this process has imported, for its worker processes."""
    return tuple(_loaded.values())


def load_plugin(path: str | Path) -> None:
    """Import a Python file, and register the terrains and overlays in it.

    The file may import modules beside it. Nothing but a caller's own path is ever imported: a map
    or a config has only names of classes.

    Args:
        path: The file. A file that was imported before is not imported again.

    Raises:
        ConfigError: if it is not a Python file, or another file has its name.
        PluginError: if its code fails, or a class in it cannot be registered.
    """
    if not isfile(path) or Path(path).suffix != ".py":  # noqa: PTH113 - raises no OSError
        raise ConfigError(f"--plugin: got {path}; expected a Python file, such as bump.py")
    file = Path(path).resolve()
    name = f"plugin_{file.stem}"
    if _loaded.get(name, file) != file:
        raise ConfigError(f"--plugin: got {_loaded[name]} and {file}; expected different names")
    if name in _loaded:
        return
    if str(file.parent) not in sys.path:
        sys.path.append(str(file.parent))  # last, so that its files replace no other module
    with plugin_errors(f"--plugin {path}"):
        spec = spec_from_file_location(name, file)
        assert spec is not None  # a file with this suffix has both
        assert spec.loader is not None
        module = sys.modules[name] = module_from_spec(spec)  # dataclasses look their module up
        spec.loader.exec_module(module)
        found = [value for value in vars(module).values() if inspect.isclass(value)]
        parents = {parent for item in found for parent in item.__mro__[1:]}
        for item in found:
            # A parent of others needs no decorator of its own.
            is_declared = "__dataclass_fields__" in vars(item) or item not in parents
            if is_built_in(item) or inspect.isabstract(item) or not is_declared:
                continue
            if issubclass(item, Terrain):
                register_terrain(item)
            elif issubclass(item, Overlay):
                register_overlay(item)
    _loaded[name] = file
