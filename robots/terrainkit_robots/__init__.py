"""Load, check and onboard robot files; train and evaluate policies for legged robots.

The public names are those of `__init__.pyi`, imported on first use, so that
`import terrainkit_robots` costs nothing.
"""

from typing import Any


def __getattr__(name: str) -> Any:
    from terrainkit.lazy_names import import_name

    value = globals()[name] = import_name(__name__, name)
    return value


def __dir__() -> list[str]:
    return sorted({*globals(), *__getattr__("__all__")})
