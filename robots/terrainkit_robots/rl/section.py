"""Former path of the base class of the sections."""

from terrainkit.annotations import PositiveFloat as Positive
from terrainkit.schema import Config as Section

__all__ = ["Positive", "Section"]
