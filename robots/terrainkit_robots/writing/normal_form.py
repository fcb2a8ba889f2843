"""The normal form: a robot as both formats can hold it, whatever file it came from.

Links are those of the main tree, each after its parent. Positions of joints count from where the
file has its zero, axes are unit vectors, masses are numbers. What a format cannot say is left out
and told in `notes`, never silently.
"""

from dataclasses import dataclass
from typing import TYPE_CHECKING

from terrainkit_robots.model import RobotModel

if TYPE_CHECKING:
    from terrainkit_robots.facts import Facts


@dataclass(frozen=True, kw_only=True, eq=False)
class NormalForm:
    """A robot that can be written."""

    model: RobotModel
    """Its links and joints, depth first; of joints only fixed ones and those with one degree of
    freedom. `reference` of every joint is 0. `anchor` may be set, and links may be virtual: MJCF
    holds both, and URDF gets frames for them."""

    floating: bool
    """Whether the base moves freely."""

    notes: tuple[str, ...] = ()
    """What was left out or changed, a sentence each."""


def normal_form(facts: "Facts", *, floating: bool | None = None) -> NormalForm:
    """Return a robot in its normal form.

    Args:
        facts: The robot.
        floating: Whether the base moves freely; unless told, as the file says or the legs suggest.

    Raises:
        RobotFileError: if there is no robot to be written.
    """
    raise NotImplementedError
