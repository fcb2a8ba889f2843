"""Tables and texts of the tests, in TOML files beside them."""

import tomllib
from pathlib import Path


def read_table(test_file, name):
    """Return a value of the TOML file that has the name of a test file.

    Args:
        test_file: `__file__` of the test.
        name: Key of the value.

    Returns:
        A list of rows, a dictionary, or a text; arrays are lists.
    """
    return tomllib.loads(Path(test_file).with_suffix(".toml").read_text(encoding="utf-8"))[name]
