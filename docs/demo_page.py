"""Write a page with a recorded walk of the demo, which a browser opens from the file.

python docs/demo_page.py demo.html
"""

import socket
import sys
from pathlib import Path

from terrainkit.viewer.viewer_server import viewer_server
from terrainkit_robots.policy.load_policy import single_torch_thread
from terrainkit_robots.rl.run import open_run
from terrainkit_robots.viewer.ground_scene import DEMO_MAP
from terrainkit_robots.viewer.show_policy import PolicyView

POLICY = "quadruped_hard"
SECONDS = 40.0
FRAME_TIME = 0.04
"""Time between two poses [s]."""


@single_torch_thread()
def demo_page(seconds: float = SECONDS) -> str:
    """Return a page on which the robot walks over the course for some seconds, again and again."""
    with socket.create_server(("localhost", 0)) as free:
        port = free.getsockname()[1]
    with viewer_server("localhost", port) as server:
        view = PolicyView(server, open_run(POLICY), terrain=str(DEMO_MAP))
        recording = server.get_scene_serializer()
        for _ in range(round(seconds / FRAME_TIME)):
            for _ in range(round(FRAME_TIME / view.env.cfg.dt)):
                view.step()
            assert view.falls.value == "0", "the robot fell"
            view.update_robot()
            recording.insert_sleep(FRAME_TIME)
        return recording.as_html()


if __name__ == "__main__":
    target = Path(sys.argv[1])
    target.parent.mkdir(exist_ok=True)
    target.write_text(demo_page())
