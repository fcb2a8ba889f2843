import gc
import math
import socket
import threading
from contextlib import closing
from http.client import HTTPConnection
from unittest.mock import Mock

import pytest
import viser

from terrainkit.viewer.viewer_server import viewer_server
from tests.viewer_client import CAMERA, connect_to, send, status_of, update, wait_for

HOST_NAME = socket.gethostname()


OWN = [
    ("localhost:{port}", None),
    ("localhost:{port}", "http://localhost:{port}"),
    ("localhost:9000", "http://localhost:9000"),  # ssh -L 9000:localhost:8080
    ("localhost", "http://localhost"),
    ("localhost:9000", "https://localhost:9000"),  # a proxy
    ("127.0.0.1:{port}", "http://127.0.0.1:{port}"),
    ("127.9.8.7:{port}", None),
    ("[::1]:{port}", "http://[::1]:{port}"),
    (f"{HOST_NAME}:{{port}}", f"http://{HOST_NAME}:{{port}}"),
    ("LOCALHOST:{port}", None),
]
FOREIGN = [
    ("localhost:{port}", "http://evil.example"),
    ("localhost:{port}", "http://evil.example:{port}"),
    ("localhost:{port}", "null"),
    ("localhost:{port}", "http://localhost"),  # another server of this machine
    ("localhost:{port}", "http://127.0.0.1:{port}"),
    ("localhost:{port}", "http://localhost:{port}.evil.example"),
    ("localhost:{port}", "ftp://localhost:{port}"),
    ("evil.example:{port}", None),
    ("localhost.evil.example:{port}", None),
    ("127.0.0.1.evil.example:{port}", None),
    ("198.51.100.1:{port}", "http://198.51.100.1:{port}"),
    ("0.0.0.0:{port}", None),
]


def test_only_own_pages_and_programs_are_answered(server):
    port = server.get_port()
    for host, origin in OWN + FOREIGN:
        headers = host.format(port=port), origin and origin.format(port=port)
        assert status_of(server, *headers) == (101 if (host, origin) in OWN else 403), headers


def test_pages_get_a_policy_and_other_sites_an_explanation(server):
    address = f"localhost:{server.get_port()}"
    for host, status in ((address, 200), ("evil.example", 403)):
        with closing(HTTPConnection("localhost", server.get_port(), timeout=10)) as page:
            page.request("GET", "/?websocket=ws://evil.example", headers={"Host": host})
            response = page.getresponse()
            assert (response.status, b"ssh -L" in response.read()) == (status, status == 403)
        # The page cannot connect to another server.
        policy = f"connect-src 'self' ws://{address} data: blob:" if status == 200 else None
        assert response.headers["Content-Security-Policy"] == policy


def test_ambiguous_headers_get_no_answer(server):
    for headers in (
        "Accept: */*",
        "Host: localhost\r\nHost: evil.example",
        "Host: evil.example\r\nHost: localhost",
        "Host: localhost\r\nOrigin: http://localhost\r\nOrigin: http://evil.example",
        "Host: evil@localhost",
        "Host: localhost/evil",
        "Host: localhost:80:80",
    ):
        with socket.create_connection(("localhost", server.get_port()), timeout=10) as client:
            client.sendall(f"GET / HTTP/1.1\r\n{headers}\r\n\r\n".encode())
            assert client.recv(12) == b"HTTP/1.1 403", headers


def test_requests_that_are_not_http_leave_the_server_running(server, capfd):
    for request in (b"\x16\x03\x01 TLS", b"\r\n", b"POST / HTTP/1.1\r\nHost: localhost\r\n\r\n"):
        with socket.create_connection(("localhost", server.get_port()), timeout=10) as client:
            client.sendall(request)
            client.shutdown(socket.SHUT_WR)
            assert b"200" not in client.recv(100)
    assert status_of(server) == 101
    assert capfd.readouterr() == ("", "")


def test_server_on_all_addresses_answers_at_any_address(make_viewer_server):
    server = make_viewer_server("0.0.0.0")
    # A container may be reached at an address of its host.
    addresses = ["0.0.0.0", "198.51.100.1", "[::1]", "[2001:db8::1]"]
    for host in (HOST_NAME, socket.getfqdn(), *addresses):
        assert status_of(server, f"{host}:9000", f"http://{host}:9000") == 101, host
    for host in ("evil.example", "198.51.100.1.evil.example"):
        assert status_of(server, f"{host}:9000") == 403, host
    assert status_of(server, "198.51.100.1:9000", "http://198.51.100.2:9000") == 403


def test_server_answers_at_the_name_of_its_host(make_viewer_server, monkeypatch):
    resolve = socket.getaddrinfo

    def resolve_robot(host, *arguments, **options):
        return resolve("localhost" if host == "robot.lab" else host, *arguments, **options)

    monkeypatch.setattr(socket, "getaddrinfo", resolve_robot)
    server = make_viewer_server("robot.lab")
    assert status_of(server, "robot.lab:9000", "http://robot.lab:9000") == 101
    assert status_of(server, "other.lab:9000") == 403


@pytest.fixture
def controls(server):
    gui = server.gui
    return {
        "slider": gui.add_slider("slider", -1.5, 2.0, 0.1, 0.5),
        "level": gui.add_slider("level", 0, 9, 1, 3),
        "checkbox": gui.add_checkbox("checkbox", initial_value=True),
        "dropdown": gui.add_dropdown("dropdown", ["0: flat", "1: stairs"]),
        "button": gui.add_button("button"),
        "disabled": gui.add_slider("disabled", 0, 9, 1, 3, disabled=True),
        "text": gui.add_text("text", "0"),
        "vector": gui.add_vector3("vector", (0.0, 0.0, 0.0)),
        "color": gui.add_rgb("color", (1, 2, 3)),
        "upload": gui.add_upload_button("upload"),
    }


ANY_KIND = [None, math.nan, math.inf, -math.inf, 1e300, 2**63, "", "x" * 10**6, b"", [], [0], {}]
VALUES = {
    "slider": ([2 + 0.9e-6, 2, -1.5 - 0.9e-6, 0.25], [2 + 1.1e-6, -1.5 - 1.1e-6, "1", True]),
    "level": ([9, 0, 5], [10, -1, "1", True]),
    "checkbox": ([False], [0, "true"]),
    "dropdown": (["1: stairs"], ["2: gap", 0, True]),
    "button": ([], [1, "true"]),
    "disabled": ([], [4]),
    "text": ([], ["text"]),
    "vector": ([], [[1.0, 1.0, 1.0], [math.nan] * 3]),
    "color": ([], [[4, 5, 6]]),
    "upload": ([], [True]),
}
"""Values that a control accepts, and others."""


@pytest.mark.parametrize("name", VALUES)
def test_values_of_controls_are_checked(server, controls, capfd, name):
    control, calls, (accepted, refused) = controls[name], [], VALUES[name]
    control._impl.update_cb.append(calls.append)
    with connect_to(server) as client:
        send(client, CAMERA)
        before = control.value
        for value in ANY_KIND + refused:
            send(client, update(control, value))
        send(client, update(controls["slider"], 1))  # messages are handled in order
        wait_for(lambda: controls["slider"].value == 1)
        assert control.value == (1 if name == "slider" else before)
        for value in accepted:
            send(client, update(control, value))
            wait_for(lambda value=value: control.value == value)
        number = len(accepted) + (name == "slider")
        wait_for(lambda: len(calls) >= number)
        assert len(calls) == number
    assert status_of(server) == 101
    assert capfd.readouterr() == ("", "")


def test_button_calls_back_when_it_is_clicked(server, controls):
    clicked = threading.Event()
    controls["button"].on_click(lambda _: clicked.set())
    with connect_to(server) as client:
        send(client, CAMERA)
        send(client, update(controls["button"], True))
        assert clicked.wait(10)


INVALID_MESSAGES = [
    b"",
    b"\xc1",
    b"\xdd\xff\xff\xff\xff",
    b"\x81\xa4type\xc4\x01x",
    b"\x81\xa2\xff\xfe\x01",
    "text",
    [],
    {},
    7,
    {"type": "GuiUpdateMessage"},
    {"type": "GuiUpdateMessage", "uuid": "unknown", "updates": {"value": 1}},
    {"type": "GuiUpdateMessage", "uuid": ["unknown"], "updates": {"value": 1}},
    {"type": "RunJavascriptMessage", "source": "alert(1)"},
    {"type": "ShareUrlRequest"},
    {"type": "GuiButtonHoldMessage", "uuid": "x", "frequency": math.nan},
    {"type": "CommandTriggerMessage", "uuid": "x"},
    {"type": "SceneNodeClickMessage", "name": "/ground", "instance_index": None},
    {"type": "FileTransferPart", "transfer_uuid": "x", "part_index": 0, "content": b"x"},
]


def test_other_messages_are_ignored(server, controls, monkeypatch, capfd):
    shared = []
    for name in ("request_share_url", "disconnect_share_url"):
        monkeypatch.setattr(server, name, lambda *_, name=name: shared.append(name))
    upload = {
        "type": "FileTransferStartUpload",
        "source_component_uuid": controls["upload"]._impl.uuid,
        "transfer_uuid": "x",
        "filename": "x",
        "mime_type": "text/plain",
        "part_count": 0,
        "size_bytes": 0,
    }
    level = update(controls["level"], 7)
    more = [{**level["updates"], name: None} for name in ("update_cb", "min", "value ")]
    with connect_to(server) as client:
        for message in (*INVALID_MESSAGES, upload, *({**level, "updates": each} for each in more)):
            send(client, message)
        send(client, update(controls["level"], 8))
        wait_for(lambda: controls["level"].value == 8)
    assert not shared
    assert controls["upload"].value.content == b""
    assert capfd.readouterr() == ("", "")


INVALID_CAMERAS = [
    ("position", (math.nan, 0, 0)),
    ("position", (1.1e6, 0, 0)),
    ("position", (1, 2)),
    ("position", (0, 0, 0.9e-6)),  # where it looks at
    ("look_at", [[0, 0, 0]] * 3),
    ("look_at", None),
    ("up_direction", (0, 0, 0.9e-6)),
    ("wxyz", (1, 0, 0)),
    ("fov", math.inf),
    ("image_height", 2**40),
    ("image_width", True),
]


@pytest.mark.parametrize(
    "valid", [{"position": (0, 0, 1.1e-6)}, {"position": (1e6, 0, 0), "up_direction": (0, 0, 2e-6)}]
)
def test_cameras_are_checked(server, valid):
    with connect_to(server) as client:
        for field, value in INVALID_CAMERAS:
            send(client, CAMERA | {field: value})
        level = server.gui.add_slider("level", 0, 9, 1, 3)
        send(client, update(level, 4))
        wait_for(lambda: level.value == 4)
        assert not server.get_clients()
        send(client, CAMERA | valid)
        wait_for(server.get_clients)
        (handle,) = server.get_clients().values()
        assert handle.camera.position.tolist() == [*map(float, valid["position"])]


def test_clients_that_left_are_not_kept(server):
    for _ in range(20):
        with connect_to(server) as client:
            send(client, CAMERA)
            wait_for(server.get_clients)
        wait_for(lambda: not server.get_clients())

    def number():
        return sum(type(each) is viser.ClientHandle for each in gc.get_objects())

    wait_for(lambda: gc.collect() >= 0 and number() <= 1)


def test_server_that_does_not_check_is_an_error(monkeypatch):
    server = Mock()
    monkeypatch.setattr(viser, "ViserServer", Mock(return_value=server))
    with pytest.raises(RuntimeError, match="does not call"), viewer_server("localhost", 8080):
        pass
    server.stop.assert_called_once_with()
