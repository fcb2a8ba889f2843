"""Triangle meshes that several tests import."""

import trimesh


def box(size, center):
    return trimesh.creation.box(size, trimesh.transformations.translation_matrix(center))


def save_bridge(folder):
    """Write a floor of 6 m x 4 m below a deck from x = 2.5 m to 3.5 m, 1 m to 1.2 m high."""
    parts = [box((6, 4, 1), (3, 2, -0.5)), box((1, 4, 0.2), (3, 2, 1.1))]
    trimesh.util.concatenate(parts).export(folder / "bridge.stl")
    return folder / "bridge.stl"
