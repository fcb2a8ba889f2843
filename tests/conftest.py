import contextlib
import dataclasses
import os
import socket
import sys

import numpy as np
import pytest
from hypothesis import settings

from terrainkit import MapConfig, SubTerrain, generate
from terrainkit.files import child_process, sandbox
from terrainkit.files.child_process import ProcessLimits
from terrainkit.geometry.solids import Solids, make_boxes, make_cylinders, make_hulls
from terrainkit.terrain import plugin_file, registry

# Before torch is imported: its threads would otherwise spin while they wait for one another, which
# takes half of the time of training where other tests keep the cores busy.
os.environ.setdefault("OMP_WAIT_POLICY", "passive")

settings.register_profile("untimed", deadline=None)
settings.load_profile("untimed")


@pytest.fixture
def make_viewer_server():
    """Return a function that starts a server of the viewer on a free port."""
    from terrainkit.viewer.viewer_server import viewer_server

    with contextlib.ExitStack() as servers:

        def make(host="localhost"):
            with socket.socket() as free:
                free.bind(("localhost", 0))
                port = free.getsockname()[1]
            return servers.enter_context(viewer_server(host, port))

        yield make


@pytest.fixture
def server(make_viewer_server):
    """Start a server of the viewer at this machine's own address."""
    return make_viewer_server()


@pytest.fixture
def own_registry(monkeypatch):
    """Yield a function that forgets what a test registers, installs or loads from a plugin file.

    The test starts without any, and afterward they are forgotten as well.
    """
    registered = {}
    monkeypatch.setattr(registry, "_registered", registered)
    monkeypatch.setattr(plugin_file, "_loaded", {})
    monkeypatch.setattr(sys, "path", [*sys.path])

    def forget():
        registered.clear()
        registry._get.cache_clear()

    forget()
    yield forget
    forget()


@pytest.fixture
def own_tasks(monkeypatch):
    """Yield a function that forgets the tasks that a test registers or loads from a file.

    Afterward they are forgotten as well.
    """
    from terrainkit_robots.rl import tasks

    before, registered = dict(tasks._registered), dict(tasks._registered)
    monkeypatch.setattr(tasks, "_registered", registered)

    def forget():
        registered.clear()
        registered.update(before)
        tasks.load_task_file.cache_clear()

    yield forget
    forget()


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
def solid_map():
    """Return level ground with solids of each kind on patch (0, 1), each with other flags."""
    flat = SubTerrain(terrain="flat")
    terrain_map = generate(
        MapConfig(rows=1, cols=2, patch_size=(6.0, 4.0), border=0.5, terrains=(flat,))
    )
    solids = Solids.concatenate(
        [
            make_boxes((1, 6, 0.5), (0.5, 2, 0.2), rpy=(0, 0, 0.3), friction=0.3),
            make_boxes((5, 6, 0.5), (0.5, 1, 0.2), collides=False),
            make_cylinders((2, 6, 0.3), 0.2, 0.8, visible=False),
            make_hulls([[[4, 6, 0], [4.5, 6, 0], [4, 6.5, 0], [4, 6, 0.4], [4.3, 6.3, 0.4]]]),
        ]
    )
    patch = np.tile(np.array([0, 1], np.int32), (len(solids), 1))
    goals = np.full((1, 2, 2, 4), np.nan, dtype=np.float32)
    goals[0, 1] = [[3, 6, 0, 0], [5.5, 6, 0, 1]]
    solids = dataclasses.replace(solids, patch=patch)
    return dataclasses.replace(terrain_map, solids=solids, goals=goals)


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


class ProcessStandIn:
    """Calls a function as `ChildProcess` does, but in this process."""

    def __init__(self, function, *arguments, limits=None):
        self.limits = limits or ProcessLimits()
        self.answers = function(iter(()), *arguments)

    def __enter__(self):
        return self

    def __exit__(self, *_):
        self.answers.close()

    def receive(self):
        try:
            return {name: np.asarray(array) for name, array in next(self.answers).items()}
        except MemoryError:
            memory = self.limits.memory / 2**30
            raise child_process.ProcessError(f"needs more than {memory:g} GB of memory") from None
        except Exception as error:
            raise child_process.ProcessError(" ".join(str(error).split())) from None


@pytest.fixture
def import_in_process(monkeypatch):
    """Read files in this process: trimesh takes most of a second to import."""
    monkeypatch.setattr(child_process, "ChildProcess", ProcessStandIn)
    monkeypatch.setattr(sandbox, "forbid_changes", lambda: True)  # for good
    before = dict(os.environ)
    yield
    # Decoders set variables for the child process, which commands of later tests would inherit.
    for name in os.environ.keys() - before.keys():
        del os.environ[name]
    if "mujoco" in sys.modules:  # the child process does not restore it
        sys.modules["mujoco"].set_mju_user_warning(None)
