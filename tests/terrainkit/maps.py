"""Small maps, and all values of a map in a form that `==` compares exactly."""

import dataclasses

import numpy as np

from terrainkit import MapConfig, SubTerrain, generate


def plot(heights, border=0.0, **config):
    """Return a map of one patch with cells of 0.1 m, with these heights of patch and border."""
    size = 0.1 * np.array(np.shape(heights)) - 2 * border
    flat = MapConfig(
        rows=1,
        cols=1,
        patch_size=tuple(size.round(6).tolist()),
        border=border,
        spawn_radius=0.05,
        terrains=(SubTerrain(terrain="flat"),),
        **config,
    )
    return dataclasses.replace(generate(flat), heights=np.array(heights, np.float32))


def contents(value):
    """Return the fields of a map, or of a value in it; arrays as type, shape and bytes."""
    if dataclasses.is_dataclass(value):
        fields = dataclasses.fields(value)
        return {field.name: contents(getattr(value, field.name)) for field in fields}
    if isinstance(value, np.ndarray) and value.dtype != object:
        return value.dtype, value.shape, value.tobytes()
    return value.tolist() if isinstance(value, np.ndarray) else value


def changed(terrain_map, name, index, value):
    """Return a map with other values at an index of one of its arrays."""
    array = getattr(terrain_map, name).copy()
    array[index] = value
    return dataclasses.replace(terrain_map, **{name: array})
