"""Courses of several terrains."""

from collections.abc import Iterator, Mapping
from contextlib import contextmanager
from dataclasses import dataclass, replace
from functools import cached_property
from typing import Annotated, Any, ClassVar, Self

import numpy as np
from msgspec import Meta
from numpy.typing import NDArray

from terrainkit.errors import ConfigError, TerrainkitError, plugin_errors, prefixed_errors
from terrainkit.features.blocks import max_number
from terrainkit.features.lane import Lane, lane_goals
from terrainkit.geometry.grid import Grid
from terrainkit.geometry.solids import Solids, check_solids
from terrainkit.settings.type_hint import MAX_VALUE
from terrainkit.terrain import Goals, Terrain, parameter, registry
from terrainkit.terrain.parameter import Parameter, Range, Value, parameters_of
from terrainkit.terrain.sub_terrain import SubTerrain

MAX_ELEMENTS = 100
"""Largest number of elements of a course."""

ELEMENT_START = 0.2
"""Flat start of a terrain with `start` as an element [m], unless it is given. The platform before
it is the start that it needs as a patch of its own."""

_ELEMENT_LENGTH = Parameter(easy=1.0, hard=1.0, snap="cells", allow_zero=False, allow_range=False)


@dataclass(frozen=True, kw_only=True)
class Element(SubTerrain):
    """A terrain of a course, with its parameters."""

    proportion: Annotated[float, Meta(gt=0, le=MAX_VALUE)] = 1.0
    """Share of the length that elements with their own leave; with the order random, of the draws.
    """

    element_length: Annotated[float, Meta(gt=0, le=MAX_VALUE)] | None = None
    """Length along x [m]; none for a share of the patch."""

    def __post_init__(self) -> None:
        super().__post_init__()
        if any(parameter.table for parameter in parameters_of(self.terrain_class).values()):
            raise ConfigError(f"terrain: got {self.terrain}; expected a terrain without elements")
        own = {"name": self.name != self.terrain, "overlays": self.overlays}
        for key, value in {**own, "friction": self.friction is not None}.items():
            if value:
                raise ConfigError(f"{self.terrain}: got {key} of an element; only a course has it")

    def __str__(self) -> str:
        return str(self.terrain)

    def to_table(self) -> dict[str, Any]:
        """Return the keys of a `[[terrains.elements]]` table."""
        length = {} if self.element_length is None else {"element_length": self.element_length}
        return {"terrain": self.terrain, **length, **super().to_table()}

    def at(self, difficulty: float) -> Terrain:
        """Return the terrain at `difficulty`, 0 to 1."""
        start = {"start": ELEMENT_START} if issubclass(self.terrain_class, Lane) else {}
        with plugin_errors(self.plugin, TerrainkitError):
            return self.terrain_class.at(difficulty, start | dict(self.parameters))


@dataclass(frozen=True, kw_only=True)
class Course(Lane):
    """A sequence of terrains in a lane along x, with flat platforms between them.

    The robot is spawned at low x. There is a goal on each platform, and one behind the last
    element. Any terrain can be an element. Elements are as wide as the patch and have its
    difficulty. They come in the given order or are drawn at random. The platforms are at height 0,
    where all terrains begin and end. The overlay `side_walls` keeps the robot in the lane. In mode
    curriculum, the rows of a column have the same elements.

    In TOML, each element is a `[[terrains.elements]]` table with `terrain`, `element_length`,
    `proportion` and the parameters of the terrain.
    """

    has_column_seed: ClassVar[bool] = True

    elements: tuple[Element, ...] = parameter.tables(
        Element(
            terrain="hurdles",
            parameters={"height": (0.05, 0.3), "min_spacing": 0.7, "max_spacing": 0.9},
        ),
        Element(
            terrain="gap_track",
            parameters={"length": (0.1, 0.5), "min_spacing": 0.7, "max_spacing": 0.9},
        ),
    )
    """Terrains along the lane."""

    order: str = parameter.choice("given", "random")
    """Order of the elements: given, or as many as fit, each drawn at random."""

    slot_length: float = parameter.length(2.0)
    """With the order random: length along x of the slots that elements are drawn for [m]."""

    platform: float = parameter.length(1.0)
    """Length of the flat platform between two elements along x [m]."""

    backward: bool = parameter.switch()
    """Spawn the robot at high x, with the goals in the opposite order."""

    def __post_init__(self) -> None:
        super().__post_init__()
        if not 1 <= len(self.elements) <= MAX_ELEMENTS:
            got = len(self.elements)
            raise ConfigError(f"course.elements: got {got}; expected 1 to {MAX_ELEMENTS}")

    @classmethod
    def at(cls, difficulty: float, values: Mapping[str, Value | Range] | None = None) -> Self:
        """Return the course at `difficulty`, with its elements; see `Terrain.at`."""
        course = super().at(difficulty, values)
        elements = []
        for k, element in enumerate(course.elements):
            with _element_errors(k, terrain := element.at(difficulty)):
                parameters = terrain.requested()
            elements.append(replace(element, parameters=parameters))
        return replace(course, elements=tuple(elements))

    def requested(self) -> dict[str, Value]:
        """Return the parameters before snapping; parameters of elements have paths as keys."""
        names = ", ".join(element.terrain for element in self.elements)
        return {**super().requested(), "elements": names, **dict(self._element_values(None))}

    def realized(self, grid: Grid) -> dict[str, Value]:
        """Return the parameters after snapping; parameters of elements have paths as keys."""
        return {**super().realized(grid), **dict(self._element_values(grid))}

    def declarations(self) -> dict[str, Parameter]:
        """Return the declared parameters; parameters of elements have paths as keys."""
        declared = super().declarations()
        for k, (element, terrain) in enumerate(zip(self.elements, self._terrains, strict=True)):
            if element.element_length is not None:
                declared[_path(k, "element_length")] = _ELEMENT_LENGTH
            with _element_errors(k, terrain):
                declarations = terrain.declarations().items()
                declared |= {_path(k, name): parameter for name, parameter in declarations}
        return declared

    def spawn(self, grid: Grid) -> tuple[float, float]:
        """Return the center of the flat start, or of as long a strip at the other end."""
        x, y = super().spawn(grid)
        return (grid.lower[0] + grid.upper[0] - x if self.backward else x), y

    def heights(self, grid: Grid, rng: np.random.Generator) -> NDArray[np.floating]:
        """Return the heights of the elements, and 0 between them."""
        ground = np.zeros(grid.shape, np.float32)
        # Solids and goals get the first child of this generator. It decides on the order.
        for k, span in self._element_slices(grid, rng.spawn(1)[0]):
            with _element_errors(k, self._terrains[k]):
                ground[span] = self._terrains[k].build(_block(grid, span), _child(rng))
        return ground

    def solids(self, grid: Grid, heights: NDArray[np.float32], rng: np.random.Generator) -> Solids:
        """Return the solids of the elements."""
        solids = []
        for k, span in self._element_slices(grid, rng):
            with _element_errors(k, terrain := self._terrains[k]):
                solids.append(terrain.solids(_block(grid, span), heights[span], _child(rng)))
                if registry.plugin_name(type(terrain)):
                    check_solids(solids[-1])
        return Solids.concatenate(solids)

    def goals(self, grid: Grid, heights: NDArray[np.float32], rng: np.random.Generator) -> Goals:
        """Return a goal in the middle of each platform except the spawn platform."""
        spans = [span for _, span in self._element_slices(grid, rng)]
        begin, end = [0, *(span.stop for span in spans)], [*(span.start for span in spans)]
        middle = np.add(begin, [*end, grid.shape[0]]) / 2
        goals = lane_goals(grid, grid.lower[0] + grid.cell * middle)
        if self.backward:
            goals[:, 3] = np.pi
        return goals[-2::-1] if self.backward else goals[1:]

    @cached_property
    def _terrains(self) -> tuple[Terrain, ...]:
        return tuple(element.at(1.0) for element in self.elements)

    def _element_slices(self, grid: Grid, rng: np.random.Generator) -> list[tuple[int, slice]]:
        """Return the elements along the lane: index into `elements`, and cells along x."""
        cells = self._element_cells(grid)
        start, platform = grid.cells(self.start), grid.cells(self.platform)
        order, slots = list(range(len(cells))), cells
        if self.order == "random":
            slot = grid.cells(self.slot_length)
            free = grid.length(grid.shape[0] - 2 * start + platform)
            number = max_number("course", grid.length(slot + platform), free)
            weights = np.array([element.proportion for element in self.elements])
            order = rng.choice(len(cells), number, p=weights / weights.sum()).tolist()
            slots = [slot] * number
        first = start + np.cumsum(np.add(slots, platform)) - np.add(slots, platform)
        return [(k, slice(i, i + cells[k])) for k, i in zip(order, first.tolist(), strict=True)]

    def _element_cells(self, grid: Grid) -> list[int]:
        """Return the cells along x of each of `elements`.

        Raises:
            ConfigError: if they do not fit in the patch.
        """
        lengths = [element.element_length for element in self.elements]
        cells = np.array([0 if length is None else grid.cells(length) for length in lengths])
        is_share = cells == 0
        total = int(cells.sum())
        free = grid.shape[0] - 2 * grid.cells(self.start)
        if self.order == "random":
            cells[is_share] = slot = grid.cells(self.slot_length)
            if slot > free or cells.max() > slot:
                raise ConfigError(
                    f"course: got elements up to {grid.length(int(cells.max())):g} m long, "
                    f"slot_length {self.slot_length:g} m and a start of {self.start:g} m at both "
                    "ends; expected no element longer than slot_length, which has to fit in a "
                    f"patch {grid.size[0]:g} m long"
                )
            return [int(number) for number in cells]
        free -= grid.cells(self.platform) * (len(cells) - 1)
        if is_share.any():
            shares = is_share * np.array([element.proportion for element in self.elements])
            ends = np.rint(np.cumsum(shares) / shares.sum() * max(free - total, 0))
            cells += np.diff(ends, prepend=0).astype(np.int64)
        if min(cells) < 1 or sum(cells) > free:
            raise ConfigError(
                f"course: got {len(cells)} elements, {grid.length(total):g} m of own lengths, "
                f"platforms of {self.platform:g} m and a start of {self.start:g} m at both ends; "
                f"expected elements that fit in a patch {grid.size[0]:g} m long"
            )
        return [int(number) for number in cells]

    def _element_values(self, grid: Grid | None) -> Iterator[tuple[str, Value]]:
        """Yield the parameters of the elements by path, requested or realized on `grid`."""
        cells = None if grid is None else self._element_cells(grid)
        for k, (element, terrain) in enumerate(zip(self.elements, self._terrains, strict=True)):
            length = element.element_length
            with _element_errors(k, terrain):
                values = terrain.requested()
                if grid is not None and cells is not None:
                    values = terrain.realized(_block(grid, slice(0, cells[k])))
                    length = length and grid.length(cells[k])
            own = {} if length is None else {"element_length": length}
            yield from ((_path(k, name), value) for name, value in (own | values).items())


def _block(grid: Grid, span: slice) -> Grid:
    """Return the grid of the cells `span` along x."""
    return grid.block((span.start, 0), (span.stop - span.start, grid.shape[1]))


@contextmanager
def _element_errors(number: int, terrain: Terrain) -> Iterator[None]:
    """Name an element in errors."""
    plugin = registry.plugin_name(type(terrain))
    with prefixed_errors(f"course.{_path(number)}: "), plugin_errors(plugin):
        yield


def _child(rng: np.random.Generator) -> np.random.Generator:
    """Return the generator of an element: each element takes one number from `rng`."""
    return np.random.default_rng(rng.integers(2**63))


def _path(number: int, name: str = "") -> str:
    """Return the path of an element, or of one of its parameters, in the course's parameters."""
    return f"elements[{number}].{name}".rstrip(".")
