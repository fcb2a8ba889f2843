import contextlib
import os
import re
import signal
import socket
import subprocess
import sys
from urllib.request import urlopen

import pytest
import viser
from websockets.sync.client import connect

import terrainkit as tk
from terrainkit.errors import ConfigError
from terrainkit_cli.view_command import View
from terrainkit_robots.description import bundled
from terrainkit_robots.policy.export import export_policy
from terrainkit_robots.rl.run import open_run
from tests.tables import read_table

DISPLAYS = "BROWSER", "DISPLAY", "WAYLAND_DISPLAY"
IPV6 = pytest.mark.skipif(not socket.has_dualstack_ipv6(), reason="there is no IPv6")


@pytest.fixture
def map_file(tmp_path):
    config = tk.MapConfig(rows=1, cols=3, border=1.0, preset="stairs")
    return tk.generate(config).save(tmp_path / "map.npz")


@contextlib.contextmanager
def started(*words):
    """Start a command that serves a page, and yield it with the address that it prints."""
    with socket.create_server(("localhost", 0)) as free:  # other tests may start at port 8080
        port = str(free.getsockname()[1])
    with subprocess.Popen(
        [sys.executable, "-m", "terrainkit_cli.main", *words, "--port", port],
        stdout=subprocess.PIPE,
        stderr=subprocess.PIPE,
        text=True,
        env={name: value for name, value in os.environ.items() if name not in DISPLAYS},
    ) as run:
        try:
            line = run.stdout.readline()
            address = re.match(
                r"http://(localhost|\[::1\]):\d+(?= shows .*; Ctrl\+C ends it\n)", line
            )
            assert address, line
            yield run, address.group()
        finally:
            run.kill()
    assert run.returncode == 0


@pytest.mark.parametrize("number", [signal.SIGINT, signal.SIGTERM])
@pytest.mark.parametrize("host", ["localhost", pytest.param("::1", marks=IPV6)])
def test_view_serves_until_it_is_ended(map_file, host, number):
    with started("view", map_file, "--host", host) as (run, address):
        with urlopen(address, timeout=10) as response:
            assert response.status == 200
        run.send_signal(number)
        assert run.communicate(timeout=30) == ("", "")


def test_demo_walks_until_it_is_ended():
    with started("demo") as (run, address):
        protocol = f"viser-v{viser.__version__}"
        page = connect(address.replace("http", "ws"), subprotocols=[protocol], max_size=None)
        with page as client:
            for _ in range(50):  # a scene at rest sends fewer messages
                assert client.recv(timeout=30)
        run.terminate()
        assert run.communicate(timeout=30) == ("", "")


@pytest.fixture
def opened(monkeypatch):
    """Addresses of the pages that the demo opened; serving ends at once."""
    pages = []
    monkeypatch.setattr("webbrowser.open", pages.append)
    monkeypatch.setattr("terrainkit_robots.viewer.show_policy.PolicyView.run", lambda _: None)
    for name in DISPLAYS:
        monkeypatch.delenv(name, raising=False)
    return pages


def test_demo_opens_the_page_only_on_a_display(terrainkit, opened, monkeypatch):
    monkeypatch.setattr("sys.platform", "linux")
    assert terrainkit("demo").returncode == 0
    assert opened == []
    monkeypatch.setenv("DISPLAY", ":0")
    assert terrainkit("demo", "--no-browser").returncode == 0
    assert opened == []
    run = terrainkit("demo")
    assert [run.stdout.partition(" shows ")[0]] == opened


@pytest.mark.usefixtures("opened")
def test_demo_serves_the_ground_before_it_loads_the_policy(terrainkit, monkeypatch):
    def fail(*_, **__):
        raise ConfigError("no policy")

    monkeypatch.setattr("terrainkit_robots.rl.run.open_run", fail)
    run = terrainkit("demo")
    assert run.returncode == 2
    assert re.match(r"http://localhost:\d+ shows the walking quadruped", run.stdout)


def test_demo_without_its_packages_names_the_extra(rejected, monkeypatch):
    monkeypatch.setitem(sys.modules, "viser", None)
    assert rejected("demo").startswith("missing packages: viser; run: pip install '.[demo]'")


@pytest.mark.parametrize(("words", "message"), read_table(__file__, "view_rejects_invalid_input"))
@pytest.mark.usefixtures("map_file")
def test_view_rejects_invalid_input(rejected, tmp_path, words, message):
    (tmp_path / "empty").mkdir()
    (tmp_path / "no_robot.urdf").write_text("<sdf/>")
    assert message in rejected(f"view {words}")


def test_view_needs_an_address_of_this_machine():
    with pytest.raises(ConfigError, match=r"got 192\.0\.2\.1, which is not an address of this"):
        View(host="192.0.2.1").check_address()  # an address for documentation


@pytest.mark.usefixtures("map_file")
def test_view_without_viser_names_the_extra(rejected, monkeypatch):
    monkeypatch.setitem(sys.modules, "viser", None)
    monkeypatch.delitem(sys.modules, "terrainkit.viewer.viewer_server", raising=False)
    assert "pip install '.[view]'" in rejected("view map.npz")


@pytest.fixture
def served(monkeypatch):
    """Names of the nodes of the scenes that were served; serving ends at once."""
    names = []
    add = viser.SceneApi.add_frame

    def record(scene, name, **options):
        names.append(name)
        return add(scene, name, **options)

    monkeypatch.setattr(viser.SceneApi, "add_frame", record)
    monkeypatch.setattr("terrainkit_cli.view_command.wait", lambda: None)
    monkeypatch.setattr("terrainkit_robots.viewer.show_policy.PolicyView.run", lambda _: None)
    return names


@pytest.mark.parametrize(
    "words",
    [("quadruped",), ("folder",), ("quadruped", "--policy"), ("walk", "--terrain", "plane")],
)
def test_view_shows_robots_and_policies(run_beside_walk, served, walking, words):
    folder = bundled.urdf_path("quadruped").parent
    (walking.parent / "folder").symlink_to(folder)
    code, output, errors = run_beside_walk("view", *words)
    assert code == 0, errors
    assert re.match(rf"http://localhost:\d+ shows {words[0]}; Ctrl\+C ends it\n", output)
    assert "/robot/body_12" in served


def test_view_shows_policies_of_other_projects(run_beside_walk, served, walking):
    export_policy(open_run(walking), walking.parent / "out")
    (walking.parent / "out" / "policy.json").rename(walking.parent / "contract.json")
    words = "view out/policy.onnx --robot quadruped --contract contract.json"
    code, output, errors = run_beside_walk(*words.split())
    assert code == 0, errors
    assert " shows out/policy.onnx; " in output
    assert "/robot/body_12" in served


def test_view_reads_options_of_robot_files(run_beside_walk, served, walking):
    joint = "<joint name='j' type='continuous'><parent link='a'/><child link='b'/></joint>"
    (walking.parent / "robot.urdf.xacro").write_text(
        "<robot xmlns:xacro='http://www.ros.org/wiki/xacro' name='r'><link name='a'/>"
        "<xacro:arg name='joined' default='false'/><xacro:if value='$(arg joined)'>"
        f"<link name='b'/>{joint}</xacro:if></robot>"
    )
    code, _, errors = run_beside_walk("view", "robot.urdf.xacro", "--xacro-arg", "joined:=true")
    assert code == 0, errors
    assert "/robot/body_1" in served
