import mujoco
import numpy as np
import pytest

from terrainkit.geometry import solid_index
from terrainkit.geometry.solid_index import SolidIndex
from terrainkit.geometry.solids import Solids, make_boxes, make_cylinders, make_hulls

HALF = np.sqrt(0.5)
CUBE = make_boxes((0, 0, 1), (1, 1, 1))
POST = make_cylinders((0, 0, 1), 0.5, 2)
LYING = make_cylinders((0, 0, 1), 0.5, 2, rpy=(0, np.pi / 2, 0))  # along x
LEANING = make_cylinders((0, 0, 1), 0.5, 4, rpy=(0, np.pi / 4, 0))  # along x = z
PLATE = make_boxes((0, 0, 1), (2, 2, 0.1), rpy=(0, np.pi / 4, 0))  # falls with x
TETRAHEDRON = make_hulls([[[0, 0, 0], [1, 0, 0], [0, 1, 0], [0, 0, 1]]])


def intervals(solids, *xy, radius=0.0):
    return SolidIndex(solids, radius=radius).intervals(np.array(xy, dtype=float))


@pytest.mark.parametrize(
    ("solid", "xy", "radius", "expected"),
    [
        (CUBE, (0.49, -0.49), 0, [0.5, 1.5]),
        (CUBE, (0.51, 0), 0, None),
        (CUBE, (0.79, 0.79), 0.3, [0.5, 1.5]),  # corners stay sharp
        (CUBE, (0.81, 0), 0.3, None),
        (POST, (0.3, 0.39), 0, [0, 2]),
        (POST, (0.79, 0), 0.3, [0, 2]),
        (POST, (0.81, 0), 0.3, None),
        (POST, (0.57, 0.57), 0.3, None),  # a post stays round
        (LYING, (1.01, 0), 0, None),
        (LYING, (0.9, 0.2), 0.3, [0.5, 1.5]),  # no higher than without a radius
        (LYING, (1.31, 0), 0.3, None),
        # Around z = 1 + x; a chord at a right angle to the axis is sqrt(2) as long along z.
        (LEANING, (0.2, 0.3), 0, [1.2 - 0.4 / HALF, 1.2 + 0.4 / HALF]),
        # At x = 1.6, the end plane x + z - 1 = 2 sqrt(2) cuts the top.
        (LEANING, (1.6, 0), 0, [2.6 - 0.5 / HALF, 1 + 4 * HALF - 1.6]),
        (PLATE, (0.2, 0), 0, [0.8 - 0.05 / HALF, 0.8 + 0.05 / HALF]),
        (TETRAHEDRON, (0.25, 0.25), 0, [0, 0.5]),
        (TETRAHEDRON, (-0.1, 0.25), 0.2, [0, 0.85 + 0.2 * np.sqrt(2)]),
    ],
)
def test_intervals_of_a_solid(solid, xy, radius, expected):
    found = intervals(solid, xy, radius=radius)
    if expected is None:
        assert found.shape[1] == 0
    else:
        assert found[0] == pytest.approx(np.array([expected]), abs=1e-6)


def test_intervals_are_in_the_order_of_their_bottoms():
    stack = make_boxes([[0, 0, 3], [0, 0, 1], [9, 0, 2]], (1, 1, 1))
    found = intervals(stack, (0, 0), (9, 0), (5, 5))
    expected = [[[0.5, 1.5], [2.5, 3.5]], [[1.5, 2.5], [np.nan] * 2], [[np.nan] * 2] * 2]
    np.testing.assert_array_equal(found, expected)


def test_intervals_without_solids_or_points():
    assert intervals(Solids.empty(), (0, 0)).shape == (1, 0, 2)
    assert SolidIndex(CUBE).intervals(np.empty((0, 2))).shape == (0, 0, 2)


def random_solids(rng, number):
    def poses():
        return rng.uniform(-4, 4, (number, 3)), rng.uniform(-np.pi, np.pi, (number, 3))

    center, rpy = poses()
    boxes = make_boxes(center, rng.uniform(0.05, 1.5, (number, 3)), rpy=rpy)
    center, rpy = poses()
    cylinders = make_cylinders(
        center, rng.uniform(0.05, 1, number), rng.uniform(0.1, 2, number), rpy=rpy
    )
    center, _ = poses()
    hulls = make_hulls([p + rng.uniform(-0.8, 0.8, (12, 3)) for p in center])
    return Solids.concatenate([boxes, cylinders, hulls])


@pytest.mark.parametrize("number", [1, 20])
def test_intervals_agree_with_mujoco(number):
    rng = np.random.default_rng(number)
    solids = random_solids(rng, number)
    spec = mujoco.MjSpec()
    for kind, shapes in (("BOX", solids.boxes), ("CYLINDER", solids.cylinders)):
        for row in shapes.astype(float):
            size = row[3:6] if kind == "BOX" else [row[3], row[5], 0]
            geom = getattr(mujoco.mjtGeom, f"mjGEOM_{kind}")
            spec.worldbody.add_geom(type=geom, pos=row[:3], size=size, quat=row[6:])
    for k, vertices in enumerate(solids.hulls()):
        spec.add_mesh(name=f"hull{k}", uservert=vertices.ravel())
        spec.worldbody.add_geom(type=mujoco.mjtGeom.mjGEOM_MESH, meshname=f"hull{k}")
    model = spec.compile()
    data = mujoco.MjData(model)
    mujoco.mj_forward(model, data)

    xy = rng.uniform(-4, 4, (300, 2))
    found = intervals(solids, *xy)
    hits = 0
    for (x, y), lines in zip(xy, found, strict=True):
        lines = lines[~np.isnan(lines[:, 0])]
        for start, direction, expected in (
            (20.0, -1.0, lines[:, 1].max(initial=-np.inf)),
            (-20.0, 1.0, lines[:, 0].min(initial=np.inf)),
        ):
            normal, geom = np.zeros(3), np.zeros(1, dtype=np.int32)
            distance = mujoco.mj_ray(
                model, data, [x, y, start], [0, 0, direction], None, 1, -1, geom, normal
            )
            if distance < 0 or abs(normal[2]) < 0.05:
                continue  # at a silhouette, rounding decides
            hits += 1
            assert start + direction * distance == pytest.approx(expected, abs=1e-3)
    assert hits >= 20 * min(number, 10)


@pytest.mark.parametrize(("name", "value"), [("MAX_PAIRS", 5), ("MIN_BIN", 50.0), ("MAX_BINS", 4)])
def test_intervals_do_not_depend_on_blocks_and_bins(monkeypatch, name, value):
    rng = np.random.default_rng(0)
    solids, xy = random_solids(rng, 10), rng.uniform(-6, 6, (200, 2))
    expected = intervals(solids, *xy)
    monkeypatch.setattr(solid_index, name, value)
    np.testing.assert_array_equal(intervals(solids, *xy), expected)
