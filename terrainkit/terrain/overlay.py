"""Overlay: the abstract class of all overlays."""

from abc import ABC, abstractmethod
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING, Any, Self

from terrainkit.settings.schema import Config
from terrainkit.terrain.parameter import convert_range, parameters_of
from terrainkit.terrain.parameterized import Parameterized
from terrainkit.terrain.patch_geometry import PatchGeometry

if TYPE_CHECKING:
    import numpy as np


@dataclass(frozen=True, kw_only=True)
class Overlay(Parameterized, Config, ABC):
    """A change to the patches of any terrain.

    An overlay is a frozen dataclass with the method `apply`. Its fields are declared like a
    terrain's. Unlike a terrain, it may hold ranges (easy, hard), as its defaults do: `at`
    interpolates them.
    """

    def __post_init__(self) -> None:
        for name, parameter in parameters_of(type(self)).items():
            value = convert_range(self.kind(), name, getattr(self, name), parameter)
            object.__setattr__(self, name, value)

    def at(self, difficulty: float) -> Self:
        """Return the overlay with plain numbers at `difficulty`, 0 to 1."""
        values: dict[str, Any] = {
            name: parameter.value_at(getattr(self, name), difficulty)
            for name, parameter in parameters_of(type(self)).items()
        }
        return replace(self, **values)

    def to_table(self) -> dict[str, Any]:
        """Return the keys of a `[[terrains.overlays]]` table."""
        return {"overlay": self.kind(), **self.requested()}

    @abstractmethod
    def apply(self, patch: PatchGeometry, rng: "np.random.Generator") -> PatchGeometry:
        """Return the changed patch.

        Keep the ground level around `patch.spawn`, and all solids and goals within the patch. Take
        random numbers only from `rng`, and the same number of them at every difficulty.

        Args:
            patch: Heights, friction, solids, goals and spawn position; do not change its arrays.
            rng: Generator of the overlay's random numbers.

        Raises:
            ConfigError: if the overlay does not fit the patch.
        """
