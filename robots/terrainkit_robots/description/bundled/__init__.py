"""Robots that come with the package: healthy, of primitives only, to learn from and to copy."""

from pathlib import Path

_FOLDER = Path(__file__).parent
_NAMES = ("biped", "quadruped")


def names() -> tuple[str, ...]:
    """Return the names of the bundled robots."""
    return _NAMES


def find(name: str) -> Path | None:
    """Return the URDF of the bundled robot `name`, beside its MJCF; None if there is none."""
    return _FOLDER / name / f"{name}.urdf" if name in _NAMES else None
