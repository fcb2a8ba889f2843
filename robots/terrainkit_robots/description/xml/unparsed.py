"""Look up numbers that a reader could not parse, so that no rule reports them again."""

from terrainkit_robots.description.model import RobotModel, Source


class UnparsedNumbers:
    """Numbers of a robot that are missing because they could not be parsed."""

    def __init__(self, model: RobotModel) -> None:
        self._unparsed = {
            (problem.subject, problem.attribute)
            for problem in model.problems
            if problem.code == "XML006"
        }
        self._sources = {problem.source for problem in model.problems if problem.code == "XML006"}
        self._xacro = any(problem.code == "XML004" for problem in model.problems)

    def has(self, subject: str, *attributes: str) -> bool:
        """Return whether one of the attributes of a link or joint could not be parsed.

        Always true for xacro that was not expanded.
        """
        return self._xacro or any((subject, name) in self._unparsed for name in attributes)

    def at(self, source: Source | None) -> bool:
        """Return whether a number of the element at `source` could not be parsed."""
        return self._xacro or source in self._sources
