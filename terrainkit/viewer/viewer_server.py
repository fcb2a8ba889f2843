"""The server of the viewer: viser, restricted to its own pages and to valid messages.

viser alone answers every web page that is open in a browser of the machine, and applies any value
that a page sends.
"""

import logging
import math
import re
import socket
import warnings
from collections.abc import Callable, Iterator, Mapping
from contextlib import contextmanager, redirect_stdout
from http import HTTPStatus
from io import StringIO
from typing import Annotated, Any

import msgspec
import viser
import websockets.asyncio.server
from msgspec import Meta
from websockets.asyncio.server import ServerConnection
from websockets.datastructures import Headers
from websockets.http11 import Request, Response

_MIN_LENGTH = 1e-6
"""Minimum length of the view and up directions of a camera [m]; viser raises for zero."""

_ROUNDING = 1e-6
"""Value by which a slider may exceed its limits: browsers round to at most 7 decimals."""

_RANGE = Meta(ge=-(10**6), le=10**6)
_Number = Annotated[int, _RANGE] | Annotated[float, _RANGE]
"""A number in a message; NaN is out of range, too."""

_REFUSAL = (
    "This viewer answers only at localhost, and at the names of its machine if it was started with "
    "--host. For another machine, forward its port: ssh -L 8080:localhost:8080 MACHINE\n"
)

_DECODER = msgspec.msgpack.Decoder(
    dict[str, bool | _Number | str | tuple[_Number, ...] | dict[str, bool | _Number | str]]
)

_Vector = tuple[float, float, float]


class _Camera(msgspec.Struct):
    """The pose of a camera, which a browser sends to viser."""

    wxyz: tuple[float, float, float, float]
    position: _Vector
    fov: float
    near: float
    far: float
    image_height: int
    image_width: int
    look_at: _Vector
    up_direction: _Vector


_LOGGER = logging.getLogger(__name__)
_LOGGER.addHandler(logging.NullHandler())  # websockets logs a traceback for each invalid request


@contextmanager
def viewer_server(host: str, port: int) -> Iterator[viser.ViserServer]:
    """Serve a scene and controls to browsers.

    Pages of other sites get no answer. The server ignores messages other than cameras and valid
    values of the controls, such as requests to share the scene on a public server.

    Args:
        host: Name or address to listen on; 0.0.0.0 and :: are all addresses.
        port: Port to listen on; the next free one if it is in use.

    Yields:
        The server; it has no scene yet.
    """
    hosts = _allowed_hosts(host)
    handles = dict[str, Any]()

    def check(connection: ServerConnection, request: Request, response: Response) -> Response:
        if not _is_allowed(request.headers, hosts):
            return connection.respond(HTTPStatus.FORBIDDEN, _REFUSAL)
        # Without it, a link with ?websocket=ADDRESS has the page run the code of another server.
        policy = f"connect-src 'self' ws://{request.headers['Host']} data: blob:"
        response.headers["Content-Security-Policy"] = policy
        return response

    class Connection(ServerConnection):
        async def recv(self, decode: bool | None = None) -> Any:  # noqa: ARG002
            while not _is_valid(message := await super().recv(decode=False), handles):
                pass
            return message

    server = _start_server(host, port, check, Connection)
    try:
        handles = server.gui._gui_input_handle_from_uuid
        server.gui.configure_theme(show_share_button=False)
        # Without a GPU, a browser takes 15 s for the light of viser's environment map.
        server.scene.configure_environment_map(None)
        server.scene.add_light_ambient("/ambient_light", intensity=1.5)
        with warnings.catch_warnings():  # a browser can leave at any time
            warnings.filterwarnings("ignore", "Queued a .* on a closed connection")
            yield server
    finally:
        with redirect_stdout(StringIO()):
            server.stop()


def _start_server(
    host: str, port: int, check: Callable[..., Response], connection: type[ServerConnection]
) -> viser.ViserServer:
    """Return a server of viser that checks requests and messages.

    viser has no parameters for these options of websockets' `serve`, which it looks up when it
    starts.

    Raises:
        RuntimeError: if viser starts its server in another way.
    """
    serve = websockets.asyncio.server.serve
    is_used = False

    def checked_serve(*arguments: Any, **options: Any) -> Any:
        nonlocal is_used
        is_used = True
        options |= {"process_response": check, "create_connection": connection, "logger": _LOGGER}
        return serve(*arguments, **options)

    setattr(websockets.asyncio.server, "serve", checked_serve)  # noqa: B010 - its type is the class of websockets
    try:
        with redirect_stdout(StringIO()):  # a banner
            server = viser.ViserServer(host=host, port=port, verbose=False)
    finally:
        setattr(websockets.asyncio.server, "serve", serve)  # noqa: B010
    if not is_used:
        server.stop()
        raise RuntimeError(f"viser {viser.__version__} does not call websockets' serve")
    return server


def _allowed_hosts(host: str) -> re.Pattern[str]:
    """Return the pattern of Host headers that a server on `host` answers.

    They are loopback addresses, the name of the machine and `host`, with any port, as tunnels have
    their own. A server on all addresses also answers the domain name of the machine and any address
    in place of a name: only names can be bound to the address of another machine.
    """
    names = {"localhost", "::1", socket.gethostname(), host}
    addresses = r"127(\.\d+){3}"
    if host in ("0.0.0.0", "::"):
        names |= {socket.getfqdn()}
        addresses = r"\d+(\.\d+){3}|\[[\da-f:.]+\]"
    either = "|".join(map(re.escape, names))
    return re.compile(rf"({addresses}|\[?({either})\]?)(:\d+)?", re.IGNORECASE)


def _is_allowed(headers: Headers, hosts: re.Pattern[str]) -> bool:
    """Return whether a request is from a page of this server, or not from a page.

    A page of another site has another Origin. If its name was bound to an address of this machine
    after it was loaded, it has another Host.
    """
    host = ",".join(headers.get_all("Host"))
    own_origins = {f"http://{host}", f"https://{host}"}
    return own_origins.issuperset(headers.get_all("Origin")) and bool(hosts.fullmatch(host))


def _is_valid(message: bytes, handles: Mapping[str, Any]) -> bool:
    """Return whether a message is the pose of a camera, or a value of one of the controls.

    Args:
        message: Message of a browser, in MessagePack.
        handles: The controls by identifier.
    """
    try:
        match _DECODER.decode(message):
            case {"type": "ViewerCameraMessage", **fields}:
                camera = msgspec.convert(fields, _Camera)
                distance = math.dist(camera.position, camera.look_at)
                return min(distance, math.hypot(*camera.up_direction)) > _MIN_LENGTH
            case {"type": "GuiUpdateMessage", "uuid": str(uuid), "updates": dict(new)}:
                return [*new] == ["value"] and _accepts(handles.get(uuid), new["value"])
    except (msgspec.DecodeError, ValueError):
        pass
    return False


def _accepts(handle: Any, value: object) -> bool:
    """Return whether a control accepts a value; disabled ones and other kinds accept none."""
    match handle:
        case viser.GuiCheckboxHandle(disabled=False) | viser.GuiButtonHandle(disabled=False):
            return isinstance(value, bool)
        case viser.GuiSliderHandle(disabled=False, min=low, max=high):
            is_number = isinstance(value, int | float) and not isinstance(value, bool)
            return is_number and low - _ROUNDING <= value <= high + _ROUNDING
        case viser.GuiDropdownHandle(disabled=False, options=options):
            return value in options
    return False
