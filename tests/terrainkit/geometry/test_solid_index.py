import mujoco
import numpy as np
import pytest

from terrainkit.geometry.solid_index import SolidIndex
from terrainkit.geometry.solids import Solids, make_boxes, make_cylinders, make_hulls


def spans(solids, *xy, radius=0.0):
    return SolidIndex(solids, radius=radius).spans(np.array(xy, dtype=float))


def test_spans_of_a_box_and_of_open_space():
    found = spans(make_boxes((0, 0, 1), (2, 2, 0.5)), (0.9, 0), (1.1, 0), (100, 100))
    assert found.shape == (3, 1, 2)
    assert found[0, 0].tolist() == [0.75, 1.25]
    assert np.isnan(found[1:]).all()


def test_spans_are_in_the_order_of_their_bottoms():
    stack = make_boxes([[0, 0, 3], [0, 0, 1], [9, 0, 2]], (1, 1, 1))
    assert spans(stack, (0, 0))[0].tolist() == [[0.5, 1.5], [2.5, 3.5]]


def test_spans_of_a_tilted_box():
    # A plate of thickness 0.1 at 45 degrees is 0.1 sqrt(2) thick vertically, and rises with -x.
    plate = make_boxes((0, 0, 1), (2, 2, 0.1), rpy=(0, np.pi / 4, 0))
    half = 0.05 * np.sqrt(2)
    assert spans(plate, (0.2, 0))[0, 0] == pytest.approx([0.8 - half, 0.8 + half], abs=1e-6)


def test_spans_of_cylinders():
    upright = make_cylinders((0, 0, 1), 0.5, 2)
    lying = make_cylinders((0, 0, 1), 0.5, 2, rpy=(0, np.pi / 2, 0))
    for solid, xy, expected in (
        (upright, (0.3, 0.39), [0, 2]),
        (lying, (0.9, 0.3), [0.6, 1.4]),
    ):
        assert spans(solid, xy)[0, 0] == pytest.approx(expected, abs=1e-6)
    assert np.isnan(spans(upright, (0.4, 0.4))).all()
    assert np.isnan(spans(lying, (1.1, 0.0))).all()


def test_spans_of_a_hull():
    tetrahedron = make_hulls([[[0, 0, 0], [1, 0, 0], [0, 1, 0], [0, 0, 1]]])
    assert spans(tetrahedron, (0.25, 0.25))[0, 0] == pytest.approx([0, 0.5], abs=1e-6)
    assert np.isnan(spans(tetrahedron, (0.6, 0.6))).all()


def test_spans_within_a_radius():
    box = make_boxes((0, 0, 1), (1, 1, 1))
    pole = make_cylinders((5, 0, 1), 0.1, 2)
    assert np.isnan(spans(box, (0.7, 0), radius=0.1)).all()
    assert spans(box, (0.7, 0), radius=0.3)[0, 0].tolist() == [0.5, 1.5]
    assert spans(pole, (5.35, 0), radius=0.3)[0, 0] == pytest.approx([0, 2])
    assert np.isnan(spans(pole, (5.45, 0), radius=0.3)).all()


def test_spans_without_solids_or_points():
    assert spans(Solids.empty(), (0, 0)).shape == (1, 0, 2)
    assert SolidIndex(make_boxes((0, 0, 0), (1, 1, 1))).spans(np.empty((0, 2))).shape == (0, 0, 2)


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
def test_spans_agree_with_mujoco(number):
    """MuJoCo casts a ray down from above and up from below each line, for each solid alone."""
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
    found = spans(solids, *xy)
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


@pytest.mark.parametrize("rpy", [(np.pi / 2, 0, 0), (0, np.pi / 2, 0), (np.pi / 2, 0, 0.3)])
def test_spans_radius_does_not_raise_a_cylinder(rpy):
    index = SolidIndex(make_cylinders((0, 0, 1.2), 0.1, 2.0, rpy=rpy), radius=0.5)
    xy = np.random.default_rng(0).uniform(-0.2, 0.2, (100, 2))
    bottom, top = np.moveaxis(index.spans(xy), -1, 0)
    assert bottom == pytest.approx(np.full((100, 1), 1.1), abs=1e-5)
    assert top == pytest.approx(np.full((100, 1), 1.3), abs=1e-5)
