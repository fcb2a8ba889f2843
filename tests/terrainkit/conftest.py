import pytest

from terrainkit.terrain import registry


@pytest.fixture
def real_child():
    """Read files in a child process, as outside of the tests."""


@pytest.fixture(autouse=True)
def child_in_process(request):
    if "real_child" not in request.fixturenames:
        request.getfixturevalue("import_in_process")


@pytest.fixture
def own_registry(monkeypatch):
    """Forget what a test registers or installs."""
    monkeypatch.setattr(registry, "_registered", {})
    registry._get.cache_clear()
    yield
    registry._get.cache_clear()
