"""The public names of a package, which its stub lists, imported on first use.

The stub `__init__.pyi` is what type checkers and editors read, and the list of the API from which
the pages of the docs and the check of `.ci/api` come.
"""

import ast
from functools import cache
from importlib import import_module
from importlib.util import find_spec
from pathlib import Path
from typing import Any


@cache
def public_names(package: str) -> dict[str, str]:
    """Return the public names of a package, and the module or package that each is in.

    Args:
        package: Name of a package with a stub.
    """
    spec = find_spec(package)
    assert spec is not None
    assert spec.origin is not None
    tree = ast.parse(Path(spec.origin).with_suffix(".pyi").read_text())
    imports = [node for node in tree.body if isinstance(node, ast.ImportFrom)]
    return {alias.name: node.module or package for node in imports for alias in node.names}


def import_name(package: str, name: str) -> Any:
    """Return a public name of a package.

    Args:
        package: Name of a package with a stub.
        name: The name, or `__all__` for the list of all names.

    Raises:
        AttributeError: if the package has no such name.
    """
    modules = public_names(package)
    if name == "__all__":
        return sorted(modules)
    if name not in modules:
        raise AttributeError(f"module {package!r} has no attribute {name!r}")
    if modules[name] == package:
        return import_module(f"{package}.{name}")
    return getattr(import_module(modules[name]), name)
