import importlib
import sys

import pytest

FRAMEWORKS = ("isaacgym", "isaaclab", "mjlab", "pybullet")


@pytest.mark.parametrize("name", FRAMEWORKS)
def test_missing_framework_is_one_line(name, monkeypatch):
    monkeypatch.setitem(sys.modules, name, None)
    monkeypatch.delitem(sys.modules, f"terrainkit.integrations.{name}", raising=False)
    with pytest.raises(
        ModuleNotFoundError, match=r"is not installed; install it with: .+"
    ) as error:
        importlib.import_module(f"terrainkit.integrations.{name}")
    assert "\n" not in str(error.value)
