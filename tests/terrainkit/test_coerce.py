import datetime
from typing import Literal

import numpy as np
import pytest

from terrainkit.sub_terrain import SubTerrain
from terrainkit.coerce import coerce
from terrainkit.errors import ConfigError

PIT = SubTerrain(terrain="pit")
Mode = Literal["a", "b"]


@pytest.mark.parametrize(
    ("value", "annotation", "result"),
    [
        (3, int, 3),
        (0.5, float, 0.5),
        (8, float, 8.0),
        (True, bool, True),
        ("8", str, "8"),
        ("b", Mode, "b"),
        (None, float | None, None),
        (1, float | None, 1.0),
        ([8, 4], tuple[float, float], (8.0, 4.0)),
        ((8, 4.5), tuple[float, float], (8.0, 4.5)),
        ([1, 2, 3], tuple[float, ...], (1.0, 2.0, 3.0)),
        ([], tuple[float, ...], ()),
        ([PIT], tuple[SubTerrain, ...], (PIT,)),
        (2**63 - 1, int, 2**63 - 1),
        (np.int64(3), int, 3),
        (np.int8(8), float, 8.0),
        (np.float32(0.5), float, 0.5),
        (np.float64(0.5), float | None, 0.5),
        (np.True_, bool, True),
        (np.str_("b"), Mode, "b"),
    ],
)
def test_a_value_becomes_what_the_annotation_wants(value, annotation, result):
    coerced = coerce("key", value, annotation)
    assert coerced == result
    assert type(coerced) is type(result)


def test_whole_numbers_within_a_list_become_floats():
    items = coerce("key", [8, np.float32(4)], tuple[float, float])
    assert [type(item) for item in items] == [float, float]


@pytest.mark.parametrize(
    ("value", "annotation", "message"),
    [
        ("3", int, "key is '3'; wanted a whole number"),
        (3.0, int, r"key is 3\.0; wanted a whole number"),
        (True, int, "key is True; wanted a whole number"),
        ("0.5", float, r"key is '0\.5'; wanted a number"),
        (False, float, "key is False; wanted a number"),
        (None, float, "key is None; wanted a number"),
        (datetime.date(2000, 1, 1), float, r"key is datetime\.date.*; wanted a number"),
        (np.float64(3), int, r"key is 3\.0; wanted a whole number"),
        (np.True_, float, "key is True; wanted a number"),
        (2**63, int, "key is a whole number beyond 64 bits"),
        pytest.param(10**400, float, "key is a whole number beyond 64 bits", id="10**400"),
        pytest.param(-(10**400), float | None, "key is a whole number beyond", id="-10**400"),
        (1, bool, "key is 1; wanted true or false"),
        ("true", bool, "key is 'true'; wanted true or false"),
        (3, str, "key is 3; wanted a text"),
        ("c", Mode, "key is 'c'; wanted one of: a, b"),
        (["a"], Mode, r"key is \['a'\]; wanted one of: a, b"),
        ("x", float | None, "key is 'x'; wanted a number"),
        (8.0, tuple[float, float], r"key is 8\.0; wanted a list"),
        ("84", tuple[float, float], "key is '84'; wanted a list"),
        ([8.0], tuple[float, float], "key has 1 values; wanted 2"),
        ([8.0, "4"], tuple[float, float], "key is '4'; wanted a number"),
        ([1.0, None], tuple[float, ...], "key is None; wanted a number"),
        (["pit"], tuple[SubTerrain, ...], "key is 'pit'; wanted SubTerrain"),
    ],
)
def test_nothing_is_guessed(value, annotation, message):
    with pytest.raises(ConfigError, match=message):
        coerce("key", value, annotation)
