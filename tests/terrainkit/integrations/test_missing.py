import importlib
import sys

import pytest

FRAMEWORKS = {
    "genesis": "genesis",
    "isaaclab": "isaaclab",
    "mjlab": "mjlab",
    "playground": "jax",
    "pybullet": "pybullet",
}
"""The package that each module needs."""


@pytest.mark.parametrize("name", FRAMEWORKS)
def test_missing_framework_is_one_line(name, monkeypatch):
    monkeypatch.setitem(sys.modules, FRAMEWORKS[name], None)
    monkeypatch.delitem(sys.modules, f"terrainkit.integrations.{name}", raising=False)
    with pytest.raises(
        ModuleNotFoundError, match=r"is not installed; install it with: .+"
    ) as error:
        importlib.import_module(f"terrainkit.integrations.{name}")
    assert "\n" not in str(error.value)
