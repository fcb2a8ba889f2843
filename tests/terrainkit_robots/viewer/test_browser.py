"""The pages in a browser, which takes long without a GPU; `make browser` runs it."""

import os
import time

import numpy as np
import pytest

import terrainkit as tk
from terrainkit.views.viewer import show_map
from terrainkit_robots.lint.selection import lint_selected
from terrainkit_robots.lint.settings import Settings
from terrainkit_robots.rl.run import open_run
from terrainkit_robots.viewer.show_policy import PolicyView
from terrainkit_robots.viewer.show_robot import show_robot
from tests.browser import CHROMIUM, open_page

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


def test_pages_show_scenes_without_errors(make_server, bundled):
    robot, small_map, policy = (make_server() for _ in range(3))
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
