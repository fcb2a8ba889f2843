import pytest


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
