import socket

import pytest
import viser


@pytest.fixture
def make_server():
    """Return a function that starts a server on a free port."""
    servers = []

    def make():
        with socket.socket() as free:
            free.bind(("localhost", 0))
            port = free.getsockname()[1]
        servers.append(viser.ViserServer(host="localhost", port=port, verbose=False))
        return servers[-1]

    yield make
    for server in servers:
        server.stop()


@pytest.fixture
def server(make_server):
    return make_server()


@pytest.fixture
def shown(server, monkeypatch):
    """Handles of what is added to the scene and the GUI of the server, by name or label."""
    handles = {}
    for api in (server.scene, server.gui):
        for name in dir(api):
            if name.startswith("add_"):
                add = getattr(api, name)

                def record(label, *arguments, add=add, **options):
                    handles[label] = add(label, *arguments, **options)
                    return handles[label]

                monkeypatch.setattr(api, name, record)
    return handles
