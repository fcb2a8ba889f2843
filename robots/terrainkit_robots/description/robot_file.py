"""Find the file of a robot: a path, a bundled robot, or a name of robot_descriptions.

The package `robot_descriptions` downloads the robots that others published: it clones the
repository of a robot, at a commit that each version of the package pins, into
`~/.cache/robot_descriptions` or `$ROBOT_DESCRIPTIONS_CACHE`. Nothing of such a repository is
executed.
"""

import importlib
import os
import re
from collections.abc import Mapping
from contextlib import redirect_stderr, redirect_stdout
from dataclasses import dataclass, field
from io import StringIO
from pathlib import Path

from terrainkit.errors import listing, one_line
from terrainkit.settings.text import closest_names, expected_names, truncate
from terrainkit_robots.description import bundled
from terrainkit_robots.description.xml.document import RobotFileError

_PACKAGE = "robot_descriptions"
_SUFFIX = "_description"
"""End of all names in the package."""


@dataclass(frozen=True, kw_only=True)
class RobotFile:
    """A robot file, and what is needed to read it."""

    path: Path
    """Path of the URDF, xacro or MJCF file."""

    packages: Mapping[str, Path] = field(default_factory=dict)
    """Folders of ROS packages by name."""

    xacro_arguments: Mapping[str, str] = field(default_factory=dict)
    """Values of xacro arguments by name."""


def find_robot(name: str | Path) -> RobotFile:
    """Return the file of a robot.

    Args:
        name: Path of a file, name of a bundled robot, or name of a robot in the package
            robot_descriptions, such as `go2_description`, which is downloaded unless it is in the
            cache. An existing file has priority over a name.

    Raises:
        RobotFileError: If there is no such file or robot, or it cannot be downloaded.
    """
    path = Path(name)
    try:
        is_file, exists = path.is_file(), path.exists()
    except OSError as error:
        raise RobotFileError(f"cannot read {name}: {error.strerror or error}") from error
    bundled_path = None if is_file else bundled.urdf_path(str(name))
    if bundled_path is not None or exists:
        return RobotFile(path=bundled_path or path)
    if is_description(name):
        return _find_description(str(name))
    names = bundled.robot_names()
    expected = expected_names(str(name), names, "bundled robots are")
    if f"{name}{_SUFFIX}" in _description_names():
        expected = f"did you mean {name}{_SUFFIX}? {expected[0].upper()}{expected[1:]}"
    raise RobotFileError(f"robot file: got {name}, which does not exist; {expected}")


def robot_names() -> tuple[str, ...]:
    """Return the names of the bundled robots, and of those in robot_descriptions."""
    return *bundled.robot_names(), *_description_names()


def is_description(name: str | Path) -> bool:
    """Return whether a name is, or looks like, one of robot_descriptions, and not a path."""
    return Path(name).name == str(name) and str(name).endswith(_SUFFIX) and not Path(name).exists()


def _description_names() -> tuple[str, ...]:
    """Return the names in robot_descriptions; none if it is not installed, or too old."""
    try:
        return tuple(getattr(importlib.import_module(_PACKAGE), "DESCRIPTIONS", ()))
    except ModuleNotFoundError:
        return ()


def _find_description(name: str) -> RobotFile:
    names = _description_names()
    if not names:
        raise RobotFileError(
            f"{truncate(name)}: names of published robots need the package {_PACKAGE}; install it "
            f"with: pip install -U {_PACKAGE}"
        )
    if name not in names:
        similar = closest_names(name, names)
        expected = f"expected one such as {listing(similar or names[:3])}"
        raise RobotFileError(f"no robot {truncate(name)} in {_PACKAGE}; {expected}")
    os.environ.setdefault("GIT_TERMINAL_PROMPT", "0")  # a repository that is gone needs a password
    try:
        with redirect_stdout(StringIO()), redirect_stderr(StringIO()):  # the package prints
            module = importlib.import_module(f"{_PACKAGE}.{name}")
    except Exception as error:
        reason = re.search(r"(?:fatal|error): (.*?)'?$", str(error), re.MULTILINE)
        why = one_line(reason[1] if reason else str(error))
        raise RobotFileError(f"{name}: {_PACKAGE} cannot download it: {why}") from error
    # A few modules have the URDF that their MJCF was made of, too.
    kinds = ("MJCF", "URDF", "XACRO") if "_mj_" in name else ("URDF", "XACRO", "MJCF")
    packages = getattr(module, "XACRO_PACKAGE_PATHS", {})
    return RobotFile(
        path=Path(next(filter(None, (getattr(module, f"{kind}_PATH", None) for kind in kinds)))),
        packages={package: Path(folder) for package, folder in packages.items()},
        xacro_arguments=getattr(module, "XACRO_ARGS", {}),
    )
