import numpy as np
import pytest
from hypothesis import settings

from terrainkit import MapConfig, SubTerrain, generate

settings.register_profile("untimed", deadline=None)
settings.load_profile("untimed")


@pytest.fixture(scope="session")
def terrain_map():
    # Nothing is alike along x and y, so that any swap of them shows.
    return generate(
        MapConfig(
            rows=2,
            cols=3,
            patch_size=(8.0, 4.0),
            border=1.2,
            seed=7,
            terrains=(
                SubTerrain(terrain="stairs", parameters={"step_height": (0.05, 0.2)}),
                SubTerrain(terrain="obstacles", parameters={"platform": 1.5}),
                SubTerrain(terrain="rough_slope", parameters={"platform": 1.5}),
            ),
            static_friction=0.8,
            dynamic_friction=0.6,
            restitution=0.1,
        )
    )


@pytest.fixture(scope="session")
def level_map():
    # Every step is a wall, so all ground is level.
    return generate(
        MapConfig(
            rows=2,
            cols=3,
            patch_size=(6.0, 4.0),
            border=0.5,
            seed=32,
            terrains=(
                SubTerrain(terrain="stairs", parameters={"step_height": (0.1, 0.2)}),
                SubTerrain(terrain="obstacles", parameters={"height": (0.2, 0.4), "platform": 1.5}),
                SubTerrain(terrain="gap", parameters={"width": 0.4, "platform": 2.0}),
            ),
        )
    )


@pytest.fixture(scope="session")
def ray_down():
    import trimesh

    def cast(vertices, triangles, xy):
        mesh = trimesh.Trimesh(vertices, triangles, process=False)
        origins = np.column_stack([xy, np.full(len(xy), mesh.bounds[1, 2] + 1.0)])
        down = np.broadcast_to([0.0, 0.0, -1.0], origins.shape)
        places, rays, _ = mesh.ray.intersects_location(origins, down, multiple_hits=False)
        heights = np.full(len(xy), np.nan)
        heights[rays] = places[:, 2]
        return heights

    return cast
