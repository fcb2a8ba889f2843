"""Calls of the Python functions with odd arguments."""

import os
import re
import warnings
from random import Random
from typing import Any

from fuzzing.forked import Command

_ARGUMENT = re.compile("«(.*?)»")

_EXPRESSIONS = (
    "None True 0 -1 1.5 1e300 nan inf -inf 2**63 10**400 1j '' 'a\\nb' '\\0' b'x' object() print"
    " [] [[]] {} () set() [None] [nan] [[0],[0,0]] {'a':nan} float Path('missing') Path('.')"
    " np.empty(0) np.empty((0,3)) np.zeros(()) np.zeros((2,2,2)) np.full((3,3),nan)"
    " np.eye(3)*1e300 np.array(['a']) np.array([None]) np.full((2,3),inf) np.arange(3)"
    " np.zeros((1,3),bool) np.zeros((10**5,3)) np.zeros(3)*1j np.datetime64('now') range(3)"
)


def prepare_call(lines: list[str], rng: Random) -> Command:
    """Return a call; one or two of its arguments, which «» enclose, are odd."""
    line = rng.choice(lines)
    values = _ARGUMENT.findall(line)
    for _ in range(rng.choice((1, 1, 1, 2))):
        values[rng.randrange(len(values))] = rng.choice(_EXPRESSIONS.split())
    return Command(words=[_ARGUMENT.sub(lambda _: values.pop(0), line)], run=call)


def call(words: list[str]) -> int:
    """Evaluate an expression; report an error in the way of the command line."""
    from pathlib import Path

    import numpy as np

    import terrainkit
    import terrainkit_robots
    from terrainkit import feasibility, perception

    names: dict[str, Any] = {"nan": float("nan"), "inf": float("inf"), "Path": Path, "np": np}
    names |= {"terrainkit": terrainkit, "terrainkit_robots": terrainkit_robots}
    names |= {"feasibility": feasibility, "perception": perception}
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")
        names["a_map"] = terrainkit.TerrainMap.load("map.npz")
        errors = (terrainkit.TerrainkitError, TypeError, ValueError, IndexError)
        try:
            eval(words[0], names)  # of surfaces.toml
        except errors as error:
            os.write(2, f"terrainkit: error: {error}\n".encode(errors="replace"))
            return 2
    return 0
