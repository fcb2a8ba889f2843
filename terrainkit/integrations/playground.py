"""Maps in the scenes of MuJoCo Playground, for MJX."""

from collections.abc import Mapping
from pathlib import Path
from typing import Any

from terrainkit.errors import ExportError
from terrainkit.export.mjcf_map import Collision
from terrainkit.integrations import load_map, missing
from terrainkit.integrations.mujoco import add_map
from terrainkit.map.terrain_map import TerrainMap

try:
    import jax
    import mujoco
except ModuleNotFoundError as error:
    raise missing("MJX", "pip install mujoco-mjx") from error


def write_scene(
    scene: str | Path,
    source: TerrainMap | str | Path,
    path: str | Path,
    *,
    assets: Mapping[str, bytes] | None = None,
    collision: Collision = "auto",
    num_contacts: int = 8,
) -> str:
    """Write a scene whose floor is the map, and return its path.

    A contact sensor between a geom and the floor is changed to report all contacts of the geom,
    since a map has several geoms, and MJX has no contact sensors with a body.

    Args:
        scene: MJCF of a scene of Playground, with a geom called `floor`.
        source: Map, or path of a .npz file.
        path: Target.
        assets: Contents of the files that the scene refers to; the result needs them, too.
        collision: Geometry that robots collide with; see `terrainkit.export.mjcf_map.export`.
        num_contacts: Maximum number of contacts that MJX keeps in each step for each kind of pair,
            such as sphere and heightfield. Without a limit, MJX tests every pair of geoms.

    Raises:
        ExportError: if the scene has no floor.
    """
    files = dict(assets or {})
    spec = mujoco.MjSpec.from_string(Path(scene).read_text(), include=files, assets=files)
    floor = spec.geom("floor")
    if floor is None:
        raise ExportError(f"{scene}: got no geom 'floor'; expected a scene of Playground")
    spec.delete(floor)
    others = len(spec.worldbody.geoms)
    for sensor in spec.sensors:
        if sensor.type == mujoco.mjtSensor.mjSENS_CONTACT and sensor.refname == "floor":
            sensor.reftype, sensor.refname = mujoco.mjtObj.mjOBJ_UNKNOWN, ""
    add_map(spec, source, collision=collision)
    spec.worldbody.geoms[others].name = "floor"  # environments look up the number of a floor
    for name in ("max_geom_pairs", "max_contact_points"):
        spec.add_numeric(name=name, data=[num_contacts])
    spec.compile()
    Path(path).write_text(spec.to_xml())
    return str(path)


def env_origins(source: TerrainMap | str | Path) -> Any:
    """Return the origin of each patch [m] as a JAX array, shape (rows, cols, 3)."""
    return jax.numpy.asarray(load_map(source).env_origins)
