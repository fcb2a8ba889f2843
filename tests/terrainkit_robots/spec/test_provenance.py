from dataclasses import replace

import pytest

from terrainkit_robots.spec.column import collect_provenance, rounded, rounded_length
from terrainkit_robots.spec.provenance import with_provenance
from terrainkit_robots.spec.robot_spec import Provenance

SOLVED, MEASURED = (Provenance(origin=origin) for origin in ("solved", "measured"))
GIVEN = Provenance(origin="given", reason="in my file")


@pytest.mark.parametrize(
    ("changed", "expected"),
    [
        ({}, {"effort.b": MEASURED}),
        ({"spawn_height": 0.4}, {"spawn_height": GIVEN, "effort.b": MEASURED}),
        ({"effort": {"a": 1.0, "b": 5.0}}, {"effort.b": GIVEN}),
        ({"effort": {"a": 5.0, "b": 2.0}}, {"effort.a": GIVEN, "effort.b": MEASURED}),
        # A pattern of joints with values of two origins, or with one changed value.
        ({"effort": {".*": 1.0}}, {"effort..*": GIVEN}),
        ({"stiffness": {"a": 9.0, "b": 9.0}}, {"effort.b": MEASURED}),  # has no provenance
    ],
)
def test_changed_values_are_given(spec, changed, expected):
    solved = {"spawn_height": SOLVED, "effort": SOLVED}
    derived = spec(spawn_height=0.3, provenance=solved | {"effort.b": MEASURED})
    edited = spec(**{"spawn_height": 0.3} | changed, provenance={"name": MEASURED})
    assert with_provenance(edited, derived, "my\nfile").provenance == solved | expected


@pytest.mark.parametrize(
    ("origins", "expected"),
    [
        ([], {}),
        ([SOLVED, SOLVED], {"x": SOLVED}),
        ([SOLVED, SOLVED, MEASURED], {"x": SOLVED, "x.c": MEASURED}),
        ([SOLVED, MEASURED], {"x": SOLVED, "x.b": MEASURED}),
        (
            [SOLVED, MEASURED, GIVEN],
            {"x": replace(SOLVED, reason="by joint"), "x.a": SOLVED, "x.b": MEASURED, "x.c": GIVEN},
        ),
    ],
)
def test_column_has_the_most_common_origin(origins, expected):
    column = {name: (1.0, origin) for name, origin in zip("abc", origins, strict=False)}
    assert collect_provenance({"x": column}) == expected


@pytest.mark.parametrize(
    ("function", "value", "expected"),
    [
        (rounded, 123.4567891, 123.457),
        (rounded, -0.99e-9, 0.0),
        (rounded, -1e-9, -1e-9),
        (rounded_length, 0.1004, 0.1),
        (rounded_length, -0.1236, -0.124),
        (rounded_length, 0.098765, 0.0988),
        (rounded_length, 12.34567, 12.346),
    ],
)
def test_values_are_rounded(function, value, expected):
    assert function(value) == expected
