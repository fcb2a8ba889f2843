import pytest
import trimesh

from terrainkit_robots.analysis.meshes.scale import MeshScales
from terrainkit_robots.analysis.meshes.uses import mesh_uses
from tests.small_robots import box, facts, joint, link, shape


@pytest.fixture
def part(tmp_path):
    """Return a function that makes a shape of a box of `size` x `size` / 2 x `size` / 2."""

    def make(size, scale=1.0, kind="visual"):
        path = tmp_path / f"{size}.stl"
        trimesh.creation.box([size, size / 2, size / 2]).export(path)
        scales = " ".join([str(scale)] * 3)
        return shape(f'mesh filename="{path}" scale="{scales}"', kind=kind)

    return make


def mismatches(*links, reach=0.3):
    """Return the ratios of mismatches of a chain of links, each given by its shapes."""
    names = [f"l{k}" for k in range(len(links))]
    parts = [
        each if "<link" in each else link(n, each) for n, each in zip(names, links, strict=True)
    ]
    joints = [joint(f"l{k}", f"l{k + 1}", f"0 0 {-reach}") for k in range(len(links) - 1)]
    robot = facts(*parts, *joints)
    scales = MeshScales(robot)
    found = [scales.mismatch(use) for use in mesh_uses(robot.model)]
    return [each.ratio for each in found if each is not None]


@pytest.mark.parametrize("size", [0.01, 0.05, 0.3, 1.0, 2.5])
def test_common_sizes_are_accepted(part, size):
    both = part(size) + part(size, kind="collision")
    assert mismatches(*[both] * 3) == []
    assert mismatches(*[part(1000 * size, 0.001)] * 3) == []


@pytest.mark.parametrize(
    ("diagonal", "count"),
    [
        (8.9, 0),  # 15 times the size of the robot of 0.6 m are 9 m
        (9.1, 1),
        (4.4, 0),  # and 15 times the distance to the next joints of 0.3 m are 4.5 m
        (4.6, 2),
    ],
)
def test_size_is_at_most_15_times_the_distance_of_the_joints(part, diagonal, count):
    # The diagonal of a part is sqrt(1.5) of its size. The trunk is compared with the whole robot.
    mesh = part(diagonal / 1.5**0.5)
    links = [mesh, "", ""] if diagonal > 5 else ["", mesh, mesh]
    ratios = mismatches(*links)
    assert ratios == [pytest.approx(diagonal / (0.6 if diagonal > 5 else 0.3))] * count


@pytest.mark.parametrize(("size", "is_small"), [(0.00244, True), (0.00246, False)])
def test_size_is_at_least_a_fiftieth_of_the_distance_of_the_joints(part, size, is_small):
    # The limit of the diagonal, sqrt(1.5) times the size, is 0.02 * 0.15 m.
    found = mismatches(part(size), part(0.2), reach=0.15)
    assert found == ([pytest.approx(size * 1.5**0.5 / 0.15)] if is_small else [])


@pytest.mark.parametrize("size", [0.01, 0.05, 0.3])
def test_meters_as_millimeters_are_too_small(part, size):
    shapes = part(size, 0.001) + box(" ".join([str(size)] * 3))
    ratios = mismatches(*[shapes] * 3)
    assert len(ratios) == 3
    assert max(ratios) < 0.02


@pytest.mark.parametrize(("size", "is_small"), [(0.00048, True), (0.0005, False)])
def test_only_mesh_is_at_least_a_thousandth_of_the_robot(part, size, is_small):
    expected = [pytest.approx(size * 1.5**0.5 / 0.6)] if is_small else []
    assert mismatches("", "", part(size)) == expected


def test_mismatch_of_one_mesh(part):
    right, wrong = part(0.3), part(0.31, 1000.0)
    found = mismatches(right, right, wrong, right, right)
    assert found == [pytest.approx(310 * 1.5**0.5 / 0.3)]


@pytest.mark.parametrize(("mass", "count"), [(None, 0), (3.0, 1)])
def test_massless_environment_is_accepted(part, mass, count):
    room = link("l0", part(50.0), mass=mass)
    assert mismatches(room, part(0.3), part(0.3)) == [pytest.approx(50 * 1.5**0.5 / 0.6)] * count


@pytest.mark.parametrize(
    ("sizes", "reach"),
    [
        pytest.param([(0.3, 0.002)] * 3, 0.3, id="small details"),
        pytest.param([(0.2,)] * 3, 0.0, id="intersecting axes"),
        pytest.param([(0.2,)] * 3, 0.004, id="close axes"),
        pytest.param([(2.0,), ()], 0.05, id="camera on a vehicle"),
        pytest.param([(8.0,), (25.0,)], 8.0, id="crane"),
        pytest.param([(0.3,)] * 2, 1e9, id="invalid offset"),
    ],
)
def test_plausible_sizes_are_accepted(part, sizes, reach):
    assert mismatches(*("".join(map(part, each)) for each in sizes), reach=reach) == []


def test_unreadable_mesh_is_ignored():
    assert mismatches(*[shape('mesh filename="lost.stl"')] * 2) == []
