"""Former path of the base class of the sections."""

from terrainkit.schema import Config as Section
from terrainkit.schema import PositiveFloat as Positive

__all__ = ["Positive", "Section"]
