"""Maps in MuJoCo models."""

from io import StringIO
from typing import TYPE_CHECKING

from terrainkit.export.mjcf import Collision, write_model
from terrainkit.integrations import load_map

if TYPE_CHECKING:
    from pathlib import Path

    import mujoco

    from terrainkit.terrain_map import TerrainMap


def make_spec(
    source: "TerrainMap | str | Path", *, collision: Collision = "auto"
) -> "mujoco.MjSpec":
    """Return the map as a MuJoCo model specification.

    Args:
        source: Map, or path of a .npz file.
        collision: Geometry that robots collide with; see :func:`terrainkit.export.mjcf.export`.
    """
    import mujoco

    file = StringIO()
    write_model(load_map(source), file, collision)
    return mujoco.MjSpec.from_string(file.getvalue())


def add_map(
    spec: "mujoco.MjSpec", source: "TerrainMap | str | Path", *, collision: Collision = "auto"
) -> None:
    """Add the map to the world body of `spec`, in world coordinates.

    Args:
        spec: Specification of a robot or scene.
        source: Map, or path of a .npz file.
        collision: Geometry that robots collide with; see :func:`terrainkit.export.mjcf.export`.
    """
    frame = spec.worldbody.add_frame()
    spec.attach(make_spec(source, collision=collision), frame=frame, prefix="terrain/")
