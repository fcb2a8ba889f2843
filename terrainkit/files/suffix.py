"""The modules of a package that read or write files, by suffix."""

from functools import cache
from importlib import import_module
from importlib.util import find_spec
from pathlib import Path
from pkgutil import iter_modules
from types import ModuleType

from terrainkit.errors import TerrainkitError, listing


@cache
def modules_by_suffix(package: str) -> dict[str, ModuleType]:
    """Return the modules of a package that define `SUFFIXES`, by suffix."""
    names = [module.name for module in iter_modules(import_module(package).__path__)]
    modules = [import_module(f"{package}.{name}") for name in names]
    return {suffix: module for module in modules for suffix in getattr(module, "SUFFIXES", ())}


def find_module(path: Path, package: str, label: str, error: type[TerrainkitError]) -> ModuleType:
    """Return the module of a package for the suffix of `path`.

    Args:
        path: File whose suffix selects the module.
        package: Name of the package with one module per suffix.
        label: What a module is, for the error.
        error: Class of the error.

    Raises:
        TerrainkitError: of class `error`, with `label` for what is missing, if there is none.
    """
    suffix = path.suffix.lower()
    # Importing the modules of all suffixes takes a tenth of the time of writing a small map.
    if find_spec(own := f"{package}.{suffix[1:] or '-'}"):
        module = import_module(own)
        if suffix in getattr(module, "SUFFIXES", ()):
            return module
    modules = modules_by_suffix(package)
    if suffix not in modules:
        shown = repr(path.suffix) if suffix else "a name without suffix"
        raise error(f"no {label} for {shown} ({path}); there are: {listing(modules)}")
    return modules[suffix]
