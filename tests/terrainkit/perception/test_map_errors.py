import numpy as np
import pytest
import torch

from terrainkit.errors import ConfigError
from terrainkit.perception import HeightScan, MapErrorOptions, MapErrors, RayCaster
from tests.tables import read_table
from tests.terrainkit.maps import plot

N = 400
POSE = np.tile([1.0, 1.0, 0.5], (N, 1)), np.zeros(N)


@pytest.fixture
def make(step_map):
    def make(terrain_map=step_map, seed=0, **options):
        scan, rays = HeightScan(terrain_map, (0.0, 0.4), (0.0, 0.3)), RayCaster(terrain_map)
        return MapErrors(scan, MapErrorOptions(**options), N, dt=0.25, rays=rays, seed=seed)

    return make


@pytest.fixture
def flat():
    return plot(np.zeros((20, 20)))


def test_no_errors_give_the_scan(make, step_map):
    expected = HeightScan(step_map, (0.0, 0.4), (0.0, 0.3)).below(*POSE)
    assert np.array_equal(make().below(*POSE), expected)


def test_noise_grows_by_range(make, flat):
    found = make(flat, noise=0.02, noise_per_meter=0.1).below(*map(torch.tensor, POSE))
    assert found.std(dim=0).tolist() == pytest.approx([0.02, 0.05, 0.06, 0.07], rel=0.15)


def test_drift_grows_with_the_root_of_time_until_a_reset(make, flat):
    errors = make(flat, drift=0.02)
    scans = [errors.below(*POSE) for _ in range(16)]  # 4 s
    assert np.ptp(scans[-1], axis=1).max() == 0  # the map moves as a whole
    assert scans[3][:, 0].std() == pytest.approx(0.02, rel=0.15)
    assert scans[15][:, 0].std() == pytest.approx(0.04, rel=0.15)
    errors.reset(np.arange(N))
    assert errors.below(*POSE)[:, 0].std() == pytest.approx(0.01, rel=0.15)


def test_delay_returns_past_scans_of_the_episode(make):
    errors = make(delay=(2, 2))
    heights = [
        errors.below(POSE[0] * [0, 1, 1] + [x, 0, 0], POSE[1])[0, 0] for x in (0.5, 1.5, 0.5, 0.5)
    ]
    assert heights == [0, 0, 0, 0.5]
    errors.reset([1])
    found = errors.below(POSE[0] * [0, 1, 1] + [1.5, 0, 0], POSE[1])[:2, 0]
    assert found.tolist() == [0, 0.5]


def test_missing_points_are_nan(make):
    assert np.isnan(make(missing=0.2).below(*POSE)).mean() == pytest.approx(0.2, abs=0.04)


def test_points_behind_a_ridge_are_hidden(make):
    ridge = np.zeros((20, 20))
    ridge[11:13] = 0.5  # x = 1.1 to 1.3
    errors = make(plot(ridge), occlusion=True, sensor=(0.0, 0.0, -0.2))
    assert np.isnan(errors.below(*POSE)[0]).tolist() == [False, False, True, True]
    high = make(plot(ridge), occlusion=True, sensor=(0.0, 0.0, 3.0))
    assert not np.isnan(high.below(*POSE)).any()


def test_grass_hides_the_ground_and_stays_in_place(make, flat):
    errors = make(flat, grass=0.3, grass_cover=1.0)
    xy = np.random.default_rng(0).uniform(0.0, 1.4, (N, 2))
    found = errors.below(np.column_stack([xy, POSE[1]]), POSE[1])
    assert found.min() >= 0
    assert found.max() <= 0.3
    assert found.mean() == pytest.approx(0.15, abs=0.02)
    # The point 0.4 m ahead is the point under a robot that is 0.4 m further.
    ahead = errors.below(np.column_stack([np.add(xy, (0.4, 0.0)), POSE[1]]), POSE[1])
    assert (np.isclose(ahead[:, 0], found[:, 2])).mean() > 0.99


def test_same_seed_gives_same_errors_whichever_robots_are_reset(make):
    options = {"noise": 0.1, "drift": 0.1, "delay": (0, 3), "missing": 0.1}
    a, b, c = make(**options), make(**options), make(**options, seed=1)
    for step in range(6):
        if step == 3:
            b.reset([7])
        scans = [each.below(*POSE) for each in (a, b, c)]
    same = np.isclose(scans[0], scans[1], equal_nan=True).all(axis=1)
    assert np.flatnonzero(~same).tolist() == [7]
    assert not np.isclose(scans[0], scans[2]).any()


@pytest.mark.parametrize(("options", "message"), read_table(__file__, "invalid_options"))
def test_invalid_options_are_rejected(options, message):
    with pytest.raises(ConfigError, match=message):
        MapErrorOptions(**options)


@pytest.mark.parametrize(
    ("values", "message"),
    [
        ({"num_envs": 2.5}, "num_envs: got 2.5; expected a whole number, at least 0"),
        ({"dt": np.nan}, "dt: got nan; expected a number, 1e-06 to 1000"),
    ],
)
def test_invalid_numbers_are_rejected(step_map, values, message):
    with pytest.raises(ConfigError, match=message):
        MapErrors(HeightScan(step_map), MapErrorOptions(), **({"num_envs": 1, "dt": 0.02} | values))


def test_grass_grows_with_any_seed(step_map):
    options = MapErrorOptions(grass=0.1)
    errors = MapErrors(HeightScan(step_map), options, 1, dt=0.02, seed=2**40 + 1)
    assert np.isfinite(errors.below([[1.0, 1.0, 0.5]], [0.0])).all()


def test_occlusion_needs_rays(step_map):
    options = MapErrorOptions(occlusion=True)
    with pytest.raises(ConfigError, match=r"expected rays=RayCaster\(map\)"):
        MapErrors(HeightScan(step_map), options, 1, dt=0.02)
