from pathlib import Path

import numpy as np
import pytest

from terrainkit_robots.description.mjcf.inertia import (
    apply_minimums,
    geom_inertial,
    scale_to_total_mass,
)
from terrainkit_robots.description.model import Inertial, Link, Source

SOURCE = Source(file=Path("robot.xml"), line=1)


def link(mass, inertia=None, **options):
    inertial = Inertial(source=SOURCE, mass=mass, inertia=inertia)
    return Link(name="link", source=SOURCE, inertial=inertial, **options)


def masses(links):
    return [each.inertial and each.inertial.mass for each in links]


def test_total_mass_scales_declared_masses_and_inertias():
    links = link(1.0, np.diag([1.0, 2.0, 3.0])), link(3.0), Link(name="frame", source=SOURCE)
    scaled = scale_to_total_mass(links, 10.0)
    assert masses(scaled) == [2.5, 7.5, None]
    assert np.diag(scaled[0].inertial.inertia).tolist() == [2.5, 5.0, 7.5]
    assert scaled[1].inertial.inertia is None


@pytest.mark.parametrize(
    ("given", "total"),
    [
        ([1.0, 3.0], 0.0),  # the file sets no total
        ([1.0, 3.0], -1.0),
        ([0.0, 0.0], 10.0),
        ([1.0, None], 10.0),  # not all masses are known
        ([1.0, np.inf], 10.0),
    ],
)
def test_total_mass_keeps_masses_that_have_no_factor(given, total):
    assert masses(scale_to_total_mass([link(each) for each in given], total)) == given


def test_minimums_replace_smaller_values_only():
    inertia = np.diag([-1.0, 0.5, 4.0])
    found = apply_minimums(link(0.5, inertia), 2.0, 1.0)
    assert found.mass == 2.0
    assert np.diag(found.inertia) == pytest.approx([-1.0, 1.0, 4.0])
    assert apply_minimums(link(0.0), 2.0, 0.0).mass == 2.0
    unknown = np.diag([np.nan, 0.5, 0.5])
    assert apply_minimums(link(1.0, unknown), 2.0, 1.0).inertia is unknown
    assert [apply_minimums(link(m), 2.0, 0.0).mass for m in (-1.0, 3.0, None)] == [-1.0, 3.0, None]


def test_minimums_apply_to_bodies_without_inertial():
    body = Link(name="body", source=SOURCE)
    found = apply_minimums(body, 2.0, 0.5)
    assert (found.mass, np.diag(found.inertia).tolist()) == (2.0, [0.5, 0.5, 0.5])
    assert apply_minimums(body, 0.0, 0.0) is None
    assert apply_minimums(Link(name="between", source=SOURCE, virtual=True), 2.0, 0.5) is None


def test_geom_inertial_is_in_the_frame_of_the_body():
    quarter_turn = np.array([[0.0, -1, 0, 0.1], [1, 0, 0, 0.2], [0, 0, 1, 0.3], [0, 0, 0, 1]])
    found = geom_inertial(SOURCE, (2.0, quarter_turn, np.array([1.0, 2.0, 4.0])), [])
    assert found.mass == 2.0
    assert found.origin[:3].tolist() == [[1, 0, 0, 0.1], [0, 1, 0, 0.2], [0, 0, 1, 0.3]]
    assert found.inertia == pytest.approx(np.diag([2.0, 1.0, 4.0]))
    assert geom_inertial(SOURCE, (0.0, np.eye(4), np.zeros(3)), []) is None
    missing = geom_inertial(SOURCE, (2.0, np.eye(4), np.ones(3)), [-0.5, 0.0])
    assert missing.mass == 1.5
    assert np.isnan(missing.inertia).all()
