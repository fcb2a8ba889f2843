"""A client of the viewer, which sends what a browser would, or what it must not."""

import socket
import time

import msgspec
import viser
from websockets.exceptions import InvalidStatus
from websockets.sync.client import connect

CAMERA = {
    "type": "ViewerCameraMessage",
    "wxyz": (1, 0, 0, 0),
    "position": (3.0, 0, 1.5),
    "fov": 0.7,
    "near": 0.01,
    "far": 1000,
    "image_height": 450,
    "image_width": 800,
    "look_at": (0, 0, 0),
    "up_direction": (0, 0, 1),
}
"""A message of a browser that opens the page."""


def connect_to(server, host=None, origin=None, address="localhost"):
    """Open a WebSocket with a Host header, `localhost` by default, and an Origin header."""
    port = server.get_port()
    return connect(
        f"ws://{host or f'localhost:{port}'}/",
        sock=socket.create_connection((address, port), timeout=10),
        origin=origin,
        subprotocols=[f"viser-v{viser.__version__}"],
        max_size=None,
        close_timeout=0.2,  # old versions of websockets wait until all messages are read
    )


def status_of(*arguments):
    """Return the HTTP status of opening a WebSocket: 101 once it receives the scene."""
    try:
        with connect_to(*arguments) as client:
            return 101 if client.recv(timeout=10) else None
    except InvalidStatus as error:
        return error.response.status_code


def send(client, message):
    client.send(message if isinstance(message, str | bytes) else msgspec.msgpack.encode(message))


def update(handle, value):
    """Return the message that a control changed."""
    return {"type": "GuiUpdateMessage", "uuid": handle._impl.uuid, "updates": {"value": value}}


def wait_for(condition, seconds=30):
    end = time.monotonic() + seconds
    while not condition():
        assert time.monotonic() < end, "timeout"
        time.sleep(0.01)
