"""Numbers that were written but could not be read: a reader told of them, so no rule does again."""

from terrainkit_robots.description.model import RobotModel, Source


class UnparsedNumbers:
    """The numbers of a robot that are missing because they are no numbers."""

    def __init__(self, model: RobotModel) -> None:
        self._told = {
            (problem.subject, problem.details.get("attribute", ""))
            for problem in model.problems
            if problem.code == "XML006"
        }
        self._at = {problem.source for problem in model.problems if problem.code == "XML006"}
        self._xacro = any(problem.code == "XML004" for problem in model.problems)

    def has(self, subject: str, *attributes: str) -> bool:
        """Return whether one of the attributes of a link or joint was told as wrong.

        In xacro that nobody expanded, that is told of all that is missing.
        """
        return self._xacro or any((subject, name) in self._told for name in attributes)

    def at(self, source: Source | None) -> bool:
        """Return whether a number of the element itself was told as wrong."""
        return self._xacro or source in self._at
