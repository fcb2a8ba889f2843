"""Robots that are bundled with the package; all their geometry is primitive."""

from pathlib import Path

_FOLDER = Path(__file__).parent
_NAMES = ("biped", "quadruped")


def robot_names() -> tuple[str, ...]:
    """Return the names of the bundled robots."""
    return _NAMES


def urdf_path(name: str) -> Path | None:
    """Return the URDF of a bundled robot, or None if there is no such robot.

    The robot's MJCF is in the same folder.
    """
    return _FOLDER / name / f"{name}.urdf" if name in _NAMES else None


def is_bundled(path: Path) -> bool:
    """Return whether a file belongs to a bundled robot."""
    return path.resolve().is_relative_to(_FOLDER.resolve())
