import resource
import subprocess
from types import SimpleNamespace

import pytest

from terrainkit.importing import child_process, isolated


@pytest.fixture
def real_child():
    """Read files in a child process, as outside of the tests."""


@pytest.fixture(autouse=True)
def child_in_process(request, monkeypatch):
    """Run child_process.py in this process: trimesh takes most of a second to import."""
    if "real_child" in request.fixturenames:
        return

    def run(command, **_options):
        try:
            child_process.main(*command[3:])
        except SystemExit as error:
            stderr = str(error.code).encode()
            raise subprocess.CalledProcessError(1, command, stderr=stderr) from None

    child = SimpleNamespace(
        run=run,
        TimeoutExpired=subprocess.TimeoutExpired,
        CalledProcessError=subprocess.CalledProcessError,
    )
    monkeypatch.setattr(isolated, "subprocess", child)
    monkeypatch.setattr(resource, "setrlimit", lambda *_: None)
