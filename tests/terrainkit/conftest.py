import pytest


@pytest.fixture
def real_child():
    """Read files in a child process, as outside of the tests."""


@pytest.fixture(autouse=True)
def child_in_process(request):
    if "real_child" not in request.fixturenames:
        request.getfixturevalue("import_in_process")
