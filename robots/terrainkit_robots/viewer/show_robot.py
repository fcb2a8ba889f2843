"""Show a robot file in the browser, with joint sliders and the findings of its check."""

import html
import math
import threading
from collections.abc import Callable, Mapping, Sequence
from typing import TYPE_CHECKING

import numpy as np

from terrainkit.viewer.map_scene import add_checkbox
from terrainkit_robots.analysis.facts import Facts
from terrainkit_robots.description.model import Joint, Source
from terrainkit_robots.lint.rule import Finding
from terrainkit_robots.lint.runner import Report
from terrainkit_robots.text import group
from terrainkit_robots.viewer.robot_scene import RobotScene, body_node

if TYPE_CHECKING:
    import viser

_SEVERITY_COLORS = {"error": (200, 40, 40), "warning": (215, 130, 0), "note": (60, 110, 190)}

_MAX_RANGE = 100.0
"""Largest range of a slider [rad] or [m]; wider limits are placeholders."""

_SLIDER_STEPS = 500

Place = tuple[int, tuple[float, float, float]]
"""Index of a body, and a point in its frame [m]."""


def show_robot(server: "viser.ViserServer", report: Report) -> RobotScene:
    """Add the robot of a report to the scene of a viser server, and its controls.

    The controls are a slider for each joint that does not mimic another one, a checkbox that moves
    mirrored joints together, a button for the default pose, checkboxes for the visual shapes, the
    collision shapes and the markers of findings, and a list of the findings.
    """
    facts, gui = report.facts, server.gui
    server.scene.set_up_direction("+z")
    server.scene.add_grid("/ground", width=4.0, height=4.0, cell_size=0.1, section_size=1.0)
    scene = RobotScene(server, facts)
    gui.add_html(f'<b style="margin: 0.5em">{html.escape(facts.model.title)}</b>')
    add_checkbox(server, "visual shapes", scene.visuals)
    add_checkbox(server, "collision shapes", scene.collisions, initial_value=False)
    add_checkbox(server, "markers of findings", add_markers(server, report))
    with gui.add_folder("joints"):
        JointSliders(server, facts, scene.set_positions)
    with gui.add_folder("findings"):
        gui.add_html(findings_html(report.findings))
    points = np.array([frame.position for frame in scene.bodies]) + scene.base.position
    size = max(0.5, float(np.linalg.norm(np.ptp(points, axis=0))))
    server.initial_camera.look_at = points.mean(axis=0)
    server.initial_camera.position = points.mean(axis=0) + 1.2 * size * np.array([1.0, -1.0, 0.5])
    return scene


class JointSliders:
    """A slider for each joint that does not mimic another one."""

    def __init__(
        self,
        server: "viser.ViserServer",
        facts: Facts,
        set_positions: Callable[[Mapping[str, float]], None],
    ) -> None:
        """Add the sliders, in the order of the joints, to the GUI of a server."""
        self._default, self._mirror = facts.default_pose, facts.mirror_map
        self._set_positions = set_positions
        self._lock = threading.RLock()
        self._is_updating = False
        self.mirrored = server.gui.add_checkbox("move mirrored joints", initial_value=False)
        self.reset = server.gui.add_button("default pose")
        self.reset.on_click(lambda _: self._assign(self._default))
        self.sliders = {
            joint.name: self._add_slider(server, joint)
            for joint in facts.joints
            if joint.mimic is None
        }
        """The sliders by joint name."""

    def _add_slider(
        self, server: "viser.ViserServer", joint: Joint
    ) -> "viser.GuiSliderHandle[float]":
        position = float(self._default.get(joint.name, 0.0))
        lower, upper = slider_range(joint, position)
        step = 10.0 ** math.floor(math.log10((upper - lower) / _SLIDER_STEPS))
        slider = server.gui.add_slider(f"{joint.name} [{joint.unit}]", lower, upper, step, position)
        slider.on_update(lambda _: self._on_update(joint.name))
        return slider

    def _on_update(self, name: str) -> None:
        with self._lock:  # viser calls this function in several threads
            if self._is_updating:  # assigning a value calls this function, too
                return
            values = {name: self.sliders[name].value}
            if self.mirrored.value and name in self._mirror:
                image = self._mirror[name]
                values = {image.joint: image.sign * values[name]} | values
            self._assign(values)

    def _assign(self, values: Mapping[str, float]) -> None:
        """Set sliders, and the pose of the robot; positions are clipped to the limits."""
        with self._lock:
            self._is_updating = True
            for name in values.keys() & self.sliders.keys():
                slider = self.sliders[name]
                slider.value = min(max(values[name], slider.min), slider.max)
            self._is_updating = False
            self._set_positions({name: slider.value for name, slider in self.sliders.items()})


def slider_range(joint: Joint, position: float) -> tuple[float, float]:
    """Return the range of a joint's slider [rad] or [m], which includes a position.

    It is the range of the joint, or one turn if that is missing or a placeholder.
    """
    lower, upper = joint.range or (-math.pi, math.pi)
    if not upper - lower < _MAX_RANGE:
        lower, upper = -math.pi, math.pi
    return min(lower, position), max(upper, position)


def add_markers(server: "viser.ViserServer", report: Report) -> "list[viser.SceneNodeHandle]":
    """Add a sphere and the codes of its findings to each link or joint that has findings."""
    locate = FindingPlaces(report.facts)
    located = ((locate(finding), finding) for finding in report.findings)
    places = group((place, finding) for place, finding in located if place is not None)
    size = max((np.linalg.norm(body.zero_pose[:3, 3]) for body in report.facts.bodies), default=0)
    handles: list[viser.SceneNodeHandle] = []
    for k, ((body, point), findings) in enumerate(places.items()):
        # Findings are sorted by severity.
        color = _SEVERITY_COLORS[findings[0].severity]
        node = f"{body_node(body)}/finding_{k}"
        radius = max(0.01, 0.05 * float(size))
        codes = ", ".join(dict.fromkeys(finding.code for finding in findings))
        handles += [
            server.scene.add_icosphere(node, radius, color, position=point),
            server.scene.add_label(f"{node}/codes", codes),
        ]
    return handles


class FindingPlaces:
    """Find the place of a finding on a robot: the link or joint that it is about."""

    def __init__(self, facts: Facts) -> None:
        self._by_name: dict[str, Place] = {}
        self._by_source: dict[tuple[object, int], Place] = {}
        for body in facts.bodies:
            joint = body.joint
            if joint is not None:
                self._add(joint.name, [joint.source], (body.index, _point(joint.anchor)))
            for link, pose in zip(body.links, body.poses, strict=True):
                sources = [element.source for element in (*link.collisions, *link.visuals)]
                sources += [link.inertial.source] if link.inertial is not None else []
                self._add(link.name, [link.source, *sources], (body.index, _point(pose[:3, 3])))

    def _add(self, name: str, sources: Sequence[Source], place: Place) -> None:
        self._by_name.setdefault(name, place)
        for source in sources:
            self._by_source.setdefault((source.file, source.line), place)

    def __call__(self, finding: Finding) -> Place | None:
        """Return the place of a finding; None if it is about the robot or a file."""
        by_line = self._by_source.get((finding.file, finding.line))
        return self._by_name.get(finding.subject, by_line)


def _point(vector: np.ndarray) -> tuple[float, float, float]:
    x, y, z = (float(value) for value in vector)
    return x, y, z


def findings_html(findings: Sequence[Finding]) -> str:
    """Return a list of findings as HTML. Texts of the robot's file are escaped."""
    items = []
    for finding in findings:
        color = "rgb({}, {}, {})".format(*_SEVERITY_COLORS[finding.severity])
        where = f"{finding.file.name}:{finding.line}" if finding.line else finding.file.name
        items.append(
            f'<p><b style="color: {color}">{finding.severity} {finding.code}</b> '
            f"{html.escape(finding.subject)}: {html.escape(finding.message)} "
            f"<i>{html.escape(where)}</i></p>"
        )
    return f'<div style="font-size: 80%; margin: 0.5em">{"".join(items) or "no findings"}</div>'
