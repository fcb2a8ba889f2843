import numpy as np
import pytest

from terrainkit_robots.analysis.inertia.inertial import (
    bodies_with_mass,
    has_valid_mass,
    inertia_part,
    mass_part,
    max_inertia,
)
from terrainkit_robots.analysis.inertia.merged_inertia import merged_inertia, parallel_axis
from terrainkit_robots.description.model import Inertial, Source
from tests.small_robots import URDF, facts, link
from tests.tables import read_table


@pytest.mark.parametrize(("mass", "is_valid", "has_mass"), read_table(__file__, "mass_is_valid"))
def test_mass_is_valid_in_a_range(mass, is_valid, has_mass):
    (body,) = facts(link("a", mass=mass)).bodies
    assert (has_valid_mass(body), list(bodies_with_mass([body]))) == (is_valid, [body] * has_mass)


def test_sources_and_elements_of_an_inertia():
    text = link("a", inertia="1 2 3 -5 0 0").replace("<inertial>", "\n<inertial>\n")
    with_inertial, bare = facts(text, link("b", mass=None)).model.links
    for each, maximum, lines in ((with_inertial, 5, (2, 3)), (bare, 0, (3, 3))):
        assert max_inertia(each) == maximum
        assert (mass_part(each).source.line, inertia_part(each).source.line) == lines


def part(mass, place, moments=None):
    pose = np.eye(4)
    pose[:3, 3] = place
    inertia = None if moments is None else np.diag(moments)
    source = Source(file=URDF, line=1)
    return Inertial(source=source, mass=mass, inertia=inertia), pose


def test_inertia_of_a_point_mass():
    expected = [[26, -4, -6], [-4, 20, -12], [-6, -12, 10]]
    assert parallel_axis(2.0, np.array([1.0, 2, 3])).tolist() == expected


def test_merged_inertia_of_two_parts():
    # The center is at 1.5; 1 * 1.5^2 + 3 * 0.5^2 = 3.
    parts = [part(1.0, [0, 0, 0], [1.0, 2, 3]), part(3.0, [2, 0, 0]), part(None, [9, 9, 9])]
    merged = merged_inertia(parts)
    assert (merged.mass, merged.origin[:3, 3].tolist()) == (4, [1.5, 0, 0])
    assert merged.inertia.tolist() == np.diag([1.0, 5, 6]).tolist()
    for massless in ([], [part(0.0, [1, 0, 0])], [part(1.0, [0, 0, 0]), part(-1.0, [1, 0, 0])]):
        assert merged_inertia(massless) is None
