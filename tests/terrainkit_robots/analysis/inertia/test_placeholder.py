import pytest

from terrainkit_robots.analysis.inertia.placeholder import placeholder_inertias
from tests.small_robots import box, facts, joint, link


def placeholders(*links):
    """Return the names of links with placeholders in a chain of (mass, moments, side)."""
    parts = []
    for k, (mass, moments, side) in enumerate(links):
        parts.append(link(k, box(f"{side} 1 1"), mass=mass, inertia=f"{moments} 0 0 0"))
        parts += [joint(k - 1, k, "0 0 1")] if k else []
    found = placeholder_inertias(facts(*parts).bodies)
    return [[link.name for link in members] for _, members in found]


ROUND, EXACT, OTHER = "0.01 0.02 0.02", "0.01234 0.0234 0.0234", "0.3 0.3 0.4"


def test_identity_is_a_placeholder_even_once():
    assert placeholders((1, "1 1 1", 1), (2, OTHER, 2)) == [["0"]]
    assert placeholders((1, "1 1 1.001", 1), (2, OTHER, 2)) == []


@pytest.mark.parametrize(
    ("equal", "others", "is_found"),
    [(2, 0, False), (3, 0, True), (3, 3, True), (3, 4, False), (4, 4, True)],
)
def test_equal_inertias_of_three_and_half_of_the_links_are_placeholders(equal, others, is_found):
    links = [(1, ROUND, k + 1) for k in range(equal)]
    links += [(1, f"{0.3 + k} {0.3 + k} {0.4 + k}", 1) for k in range(others)]
    assert placeholders(*links) == ([[str(k) for k in range(equal)]] if is_found else [])


@pytest.mark.parametrize(
    ("links", "is_found"),
    [
        pytest.param([(1, ROUND, 1)] * 3, False, id="equal shapes"),
        pytest.param([(1, EXACT, k) for k in (1, 2, 3)], False, id="exact, of the same mass"),
        pytest.param([(k, EXACT, k) for k in (1, 2, 3)], True, id="exact, of other masses"),
        pytest.param([(1, "0.01234 " * 3, k) for k in (1, 2, 3)], True, id="spheres"),
        pytest.param([(0, ROUND, k) for k in (1, 2, 3)], False, id="no mass"),
        pytest.param([(1, "0 0 0", k) for k in (1, 2, 3)], False, id="no inertia"),
        pytest.param([(1, "1e12 1e12 1e12", k) for k in (1, 2, 3)], False, id="out of range"),
    ],
)
def test_copies_of_one_part_are_no_placeholders(links, is_found):
    assert placeholders(*links) == ([["0", "1", "2"]] if is_found else [])
