"""The folder of an onboarded robot: there whole, or not at all."""

import shutil
import tempfile
from collections.abc import Iterator, Mapping
from contextlib import contextmanager
from pathlib import Path

from terrainkit.errors import ExportError
from terrainkit_robots.wording import names

SPEC = "robot.toml"
"""A folder that holds this file is an onboarded robot."""

KEPT = "robot.toml.before"
"""What the spec of a folder that is replaced is called in the new one."""

_OURS = frozenset(
    {SPEC, KEPT, "robot.urdf", "robot.xml", "scene.xml", "report.md", "report", "meshes"}
)
"""What onboarding writes, beside configurations."""

_CONFIG_ENDING = "_config.py"


def check_folder(target: Path, *, overwrite: bool) -> None:
    """Raise an error if an onboarded robot cannot or may not be written to `target`.

    Raises:
        ExportError: if there is something that is not to be overwritten, or no folder to write in.
    """
    try:
        if not target.parent.is_dir():
            raise ExportError(f"cannot write {target}: there is no folder {target.parent}")
        if target.is_symlink() or (target.exists() and not target.is_dir()):
            raise ExportError(f"cannot write {target}: it is there, and not a folder")
        if not target.is_dir():
            return
        held = sorted(path.name for path in target.iterdir())
    except OSError as error:
        raise ExportError(f"cannot write {target}: {error.strerror or error}") from error
    if not held:
        return
    if not overwrite:
        raise ExportError(f"{target} exists; another name would do, or --overwrite")
    if SPEC not in held:
        raise ExportError(f"{target} holds no {SPEC}: it is not an onboarded robot to overwrite")
    foreign = [name for name in held if name not in _OURS and not name.endswith(_CONFIG_ENDING)]
    if foreign:
        raise ExportError(
            f"{target} also holds {names(foreign)}, which onboarding did not write; "
            "move it away to overwrite the rest"
        )


@contextmanager
def new_folder(target: Path, *, overwrite: bool = False) -> Iterator[Path]:
    """Yield an empty folder, and move it to `target` once the block is through.

    If the block raises, nothing has changed.

    Raises:
        ExportError: as `check_folder`, and if the disk does not take it.
    """
    check_folder(target, overwrite=overwrite)
    try:
        # Beside the target, so that moving there is a rename on the same disk.
        work = Path(tempfile.mkdtemp(prefix=".terrainkit-", dir=target.parent))
    except OSError as error:
        raise ExportError(f"cannot write {target}: {error.strerror or error}") from error
    made = work / target.name
    try:
        made.mkdir()
        yield made
        check_folder(target, overwrite=overwrite)
        if target.is_dir():
            target.replace(work / "before")
        made.replace(target)
    except OSError as error:
        raise ExportError(f"cannot write {target}: {error.strerror or error}") from error
    finally:
        shutil.rmtree(work, ignore_errors=True)


def write_files(folder: Path, files: Mapping[str, bytes]) -> None:
    """Write files by their names in `folder`, which are relative and stay inside of it."""
    for name, data in files.items():
        path = folder / name
        if not path.resolve().is_relative_to(folder.resolve()):
            raise ExportError(f"{name} lies outside of {folder}")
        path.parent.mkdir(parents=True, exist_ok=True)
        path.write_bytes(data)
