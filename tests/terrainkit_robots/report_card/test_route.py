import numpy as np

from terrainkit import MapConfig, SubTerrain, make_patch
from terrainkit_robots.report_card.route import patch_routes


def make(terrain, size=(8.0, 8.0), **parameters):
    sub_terrain = SubTerrain(terrain=terrain, parameters=parameters)
    config = MapConfig(rows=1, cols=1, patch_size=size, border=0, terrains=(sub_terrain,))
    return make_patch(config, 0, 0)


def test_routes_lead_to_all_sides_from_the_center():
    routes = np.concatenate(patch_routes(make("pyramid_slope")))
    assert routes[np.lexsort(routes.T)].round(3).tolist() == [[4, 0], [0, 4], [8, 4], [4, 8]]


def test_routes_lead_to_the_end_of_a_lane():
    (route,) = patch_routes(make("stairs", size=(8.0, 4.0)))
    assert route.round(3).tolist() == [[8, 2]]


def test_routes_follow_goals():
    patch = make("hurdles")
    (route,) = patch_routes(patch)
    np.testing.assert_allclose(route, patch.goals[:, :2])
