"""The pages in a browser, which takes long without a GPU; `make browser` runs it."""

import importlib.util
import math
import os
import threading
import time
from pathlib import Path
from types import SimpleNamespace

import numpy as np
import pytest
from websockets.sync.server import serve

import terrainkit as tk
from terrainkit.viewer.map_scene import show_map
from terrainkit_robots.lint.check import lint_selected
from terrainkit_robots.lint.settings import Settings
from terrainkit_robots.rl.run import open_run
from terrainkit_robots.viewer.show_policy import PolicyView
from terrainkit_robots.viewer.show_robot import show_robot
from tests.browser import CHROMIUM, open_page
from tests.viewer_client import wait_for

pytestmark = pytest.mark.skipif(
    not (CHROMIUM and "TERRAINKIT_BROWSER" in os.environ),
    reason="there is no Chromium, or TERRAINKIT_BROWSER is not set",
)

SCENE = (slice(160, None), slice(None, 450))
"""The part of the page between the notification and the controls."""


def wait_for_picture(page, seconds=60, *, other=None):
    """Return the picture of the scene once it is not empty, and not another picture."""
    end = time.monotonic() + seconds
    while time.monotonic() < end:
        picture = page.screenshot()[SCENE].astype(int)
        if np.ptp(picture, axis=(0, 1)).max() > 60 and (
            other is None or (np.abs(picture - other).max(axis=2) > 30).mean() > 1e-3
        ):
            return picture
        time.sleep(0.2)
    pytest.fail(f"no picture; the page logged {page.errors}")


def show_on(server, page):
    page.call("Page.navigate", url=f"http://localhost:{server.get_port()}")
    page.wait_for("document.body && document.body.innerText.includes('Connected')")
    return wait_for_picture(page)


def test_pages_show_scenes_without_errors(make_viewer_server, bundled):
    robot, small_map, policy = (make_viewer_server() for _ in range(3))
    scene = show_robot(robot, lint_selected(bundled("quadruped.urdf"), Settings(simulate=False)))
    show_map(small_map, tk.generate(tk.MapConfig(rows=2, cols=3, border=1.0, preset="stairs")))
    view = PolicyView(policy, open_run("quadruped"))
    with open_page("about:blank") as page:
        shown = show_on(robot, page)
        for handle in scene.collisions:
            handle.visible = True
        wait_for_picture(page, other=shown)
        show_on(small_map, page)
        standing = show_on(policy, page)
        for _ in range(100):
            view.step()
        view.update_robot()
        wait_for_picture(page, other=standing)
        assert page.errors == []


def test_controls_of_a_page_reach_the_server(make_viewer_server):
    server = make_viewer_server()
    slider = server.gui.add_slider("slider", -math.pi, math.pi, 0.1, 3.0)
    level = server.gui.add_slider("level", 0, 9, 1, 3)
    checkbox = server.gui.add_checkbox("checkbox", initial_value=False)
    button, clicked = server.gui.add_button("button"), threading.Event()
    button.on_click(lambda _: clicked.set())
    server.scene.add_icosphere("/sphere", 1.0, (255, 0, 0))
    with open_page("about:blank") as page:
        show_on(server, page)
        wait_for(server.get_clients)  # the camera was accepted
        # A joint limit that the browser rounds, and a limit of integers.
        for k, (handle, key, value) in enumerate([(slider, "End", math.pi), (level, "Home", 0)]):
            page.evaluate(f"document.querySelectorAll('[role=slider]')[{k}].focus()")
            page.call("Input.dispatchKeyEvent", type="keyDown", key=key, code=key)
            wait_for(lambda handle=handle, value=value: handle.value == pytest.approx(value))
        page.evaluate(f"document.getElementById('{checkbox._impl.uuid}').click()")
        wait_for(lambda: checkbox.value)
        page.evaluate(f"document.getElementById('{button._impl.uuid}').click()")
        assert clicked.wait(30)
        assert page.errors == []


def test_page_of_another_origin_cannot_connect(make_viewer_server, other_server):
    port = make_viewer_server().get_port()
    with open_page(f"http://localhost:{other_server.port}") as page:
        page.wait_for("document.body.innerText === 'other'")
        for name, address in (("viewer", port), ("other", other_server.port)):
            page.evaluate(f"""{{
                const socket = new WebSocket("ws://localhost:{address}");
                socket.onopen = () => {{ window.{name} = "open" }};
                socket.onerror = () => {{ window.{name} = "error" }};
            }}""")
            page.wait_for(f"window.{name}")
        assert page.evaluate("window.viewer") == "error"
        assert page.evaluate("window.other") == "open"


def test_page_does_not_connect_to_the_server_of_a_link(make_viewer_server, other_server):
    query = f"websocket=ws://localhost:{other_server.port}"
    with open_page(f"http://localhost:{make_viewer_server().get_port()}?{query}") as page:
        wait_for(lambda: page.evaluate("0") or page.errors, seconds=60)
    assert "Content Security Policy" in page.errors[0]
    assert other_server.connected == 0


@pytest.fixture
def other_server():
    """A server of a page that accepts all WebSocket connections, and counts them."""

    def count(connection):
        counts.connected += 1
        connection.recv()

    def answer(connection, request):
        return None if "Upgrade" in request.headers else connection.respond(200, "other")

    with serve(count, "localhost", 0, process_request=answer) as server:
        counts = SimpleNamespace(port=server.socket.getsockname()[1], connected=0)
        threading.Thread(target=server.serve_forever, daemon=True).start()
        yield counts
        server.shutdown()


def test_demo_page_shows_the_walk_from_a_file(tmp_path):
    script = Path(__file__).parents[3] / "docs/demo_page.py"
    spec = importlib.util.spec_from_file_location("demo_page", script)
    module = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(module)
    file = tmp_path / "demo.html"
    file.write_text(module.demo_page(seconds=4.0))
    assert file.stat().st_size < 5e6
    with open_page(file.as_uri()) as page:
        page.wait_for("document.querySelector('canvas') !== null")
        shown = wait_for_picture(page)
        wait_for_picture(page, other=shown)
        assert page.errors == []
