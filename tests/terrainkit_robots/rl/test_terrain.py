import mujoco
import numpy as np
import pytest

from terrainkit.errors import TerrainkitError
from terrainkit_robots.quiet_mujoco import quiet_mujoco
from terrainkit_robots.rl.config import InitState
from terrainkit_robots.rl.terrain import MapGround, Plane, load_terrain

EXACT = 1e-3
ONLY_GROUND = np.array([1, 0, 0, 0, 0, 0], np.uint8)  # groups of geoms


def rays(model, xy, group=None):
    """Return the height of a model at points, by ray casting."""
    data = mujoco.MjData(model)
    mujoco.mj_forward(model, data)
    hit, heights = np.zeros(1, np.int32), np.full(len(xy), np.nan)
    for k, (x, y) in enumerate(xy):
        start, down = np.array([x, y, 30.0]), np.array([0.0, 0.0, -1.0])
        far = mujoco.mj_ray(model, data, start, down, group, 1, -1, hit, None)
        if far >= 0:
            heights[k] = 30.0 - far
    return heights


def compiled(ground):
    with quiet_mujoco():
        return ground.spec().compile()


def anywhere(ground, count, seed=0):
    low, high = np.array(ground.lower), np.array(ground.upper)
    return (low + (high - low) * np.random.default_rng(seed).random((count, 2))).astype(np.float32)


class TestPlane:
    def test_plane_is_flat_and_infinite(self):
        xy = np.float32([[0, 0], [1e4, -1e4]])
        assert (Plane().height(xy[:, 0], xy[:, 1]) == 0).all()
        assert Plane().is_plane
        np.testing.assert_allclose(rays(compiled(Plane()), xy[:1]), [0], atol=1e-9)
        assert Plane().env_origins.shape == (1, 1, 3)


class TestMapTerrain:
    @pytest.mark.parametrize("collision", ["hfield", "boxes", "auto"])
    def test_height_matches_rays(self, terrain_map, collision):
        ground = MapGround(terrain_map, collision)
        xy = anywhere(ground, 4000)
        off = np.abs(ground.height(*xy.T) - rays(compiled(ground), xy))
        # A point on a wall may be on either side of it.
        assert np.mean(off > EXACT) < 0.0005, xy[off > EXACT][:5]

    def test_height_of_solids_depends_on_the_robot(self, solid_map):
        """The box hangs from 0.4 to 0.6 m, one does not collide, and the cylinder is invisible."""
        terrain, x, y = MapGround(solid_map), np.float32([1, 5, 2]), np.float32([6, 6, 6])
        z = np.full(3, 0.5, np.float32)
        assert terrain.height(x, y, z, scan=True) == pytest.approx([0.6, 0.6, 0], abs=1e-6)
        assert terrain.height(x, y, z - 0.2) == pytest.approx([0, 0, 0.7], abs=1e-6)
        assert terrain.height(x, y) == pytest.approx([0.6, 0, 0.7], abs=1e-6)

    def test_height_accepts_any_shape(self, map_ground):
        x = np.linspace(0, 5, 12, dtype=np.float32).reshape(3, 4)
        found = map_ground.height(x, x)
        assert (found.shape, found.dtype) == ((3, 4), np.float32)  # doubles take twice the time
        flat = map_ground.height(x.ravel(), x.ravel())
        np.testing.assert_array_equal(found.ravel(), flat)

    def test_attributes_match_the_map(self, mixed_map):
        ground = MapGround(mixed_map)
        assert (ground.env_origins.shape, ground.spawns.shape) == ((3, 2, 3), (3, 2, 1, 4))
        assert ground.terrain_names.tolist() == [["stairs", "rough_slope"]] * 3
        assert ground.patch_length == 6.0
        np.testing.assert_allclose(ground.lower, (-1.2, -1.2))
        np.testing.assert_allclose(ground.upper, (3 * 6 + 1.2, 2 * 4 + 1.2))
        assert not ground.is_plane

    def test_geoms_have_the_material(self, map_ground):
        model = compiled(map_ground)
        assert (model.geom_rgba == 1).all()
        assert (model.geom_matid == model.material("ground").id).all()


class TestLoadTerrain:
    def test_load_every_kind(self, mixed_map, tmp_path):
        path = mixed_map.save(tmp_path / "map.npz")
        assert isinstance(load_terrain("plane"), Plane)
        assert isinstance(load_terrain(path), MapGround)
        assert isinstance(load_terrain(str(path)), MapGround)
        assert isinstance(load_terrain(path, "plane"), Plane)

    def test_load_config_generates_the_map(self, mixed_map, tmp_path):
        (tmp_path / "map.toml").write_text(mixed_map.config.to_toml())
        loaded = load_terrain(tmp_path / "map.toml").terrain_map
        np.testing.assert_array_equal(loaded.heights, mixed_map.heights)

    @pytest.mark.parametrize(
        ("name", "message"),
        [
            ("moon", "terrain: got 'moon'; expected plane, a map"),
            ("map.obj", "expected plane, a map"),
            ("none.npz", "none.npz"),
            ("none.toml", "none.toml"),
        ],
    )
    def test_invalid_source_is_rejected(self, tmp_path, name, message):
        source = tmp_path / name if "." in name else name
        with pytest.raises(TerrainkitError, match=message) as caught:
            load_terrain(source)
        assert "\n" not in str(caught.value)


class TestHeightScan:
    @staticmethod
    def cast(env, yaw):
        """Return the expected height scan of a robot, by ray casting."""
        points = env.cfg.terrain
        x, y = np.meshgrid(points.measured_points_x, points.measured_points_y, indexing="ij")
        base = env.sim.qpos[0]
        # The y axis of the scan is 90 degrees to the left of the heading.
        turned = (x + 1j * y).ravel() * np.exp(1j * yaw)
        at = base[:2] + np.column_stack([turned.real, turned.imag])
        return base[2] - rays(compiled(env.terrain), at, ONLY_GROUND)

    @pytest.mark.parametrize("yaw", [0.0, 0.7, 2.5, -1.6])
    @pytest.mark.parametrize("tilt", [0.0, 0.2])
    def test_height_scan_matches_rays(self, nominal_env, mixed_map, yaw, tilt):
        env = nominal_env(1, MapGround(mixed_map), init_state=InitState(position=0))
        quat = np.zeros(4)
        turn = np.array([np.cos(yaw / 2), 0, 0, np.sin(yaw / 2)])
        pitch = np.array([np.cos(tilt / 2), 0, np.sin(tilt / 2), 0])
        mujoco.mju_mulQuat(quat, turn, pitch)
        env.sim.qpos[0, :2] += (0.83, 0.41)
        env.sim.qpos[0, 3:7] = quat
        state = env._compute_state(np.arange(1))
        assert state.height_scan.shape == (1, 187)
        np.testing.assert_allclose(state.height_scan[0], self.cast(env, yaw), atol=EXACT)
        assert np.ptp(state.height_scan) > 0.05

    def test_base_height_is_above_the_ground(self, nominal_env, mixed_map):
        env = nominal_env(6, MapGround(mixed_map))
        env.sim.qpos[:, :2] += np.random.default_rng(0).uniform(-1, 1, (6, 2))
        state = env._compute_state(np.arange(6))
        under = rays(compiled(env.terrain), env.sim.qpos[:, :2], ONLY_GROUND)
        np.testing.assert_allclose(state.base_height, env.sim.qpos[:, 2] - under, atol=EXACT)
