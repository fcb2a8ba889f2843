"""Tabulate the index of each joint in every simulator."""

from collections.abc import Sequence

from terrainkit_robots.analysis.simulator_conventions.joint_order import SimulatorOrder


def order_table(
    file_order: Sequence[str], orders: Sequence[SimulatorOrder]
) -> tuple[tuple[str, ...], ...]:
    """Return the rows of a table: a header, one row per joint, and the certainty of each order.

    Args:
        file_order: Names of the joints in the order of the file.
        orders: Order of the joints in each simulator.

    Returns:
        Cells of text. Indices start at 0.
    """
    indices = [{name: index for index, name in enumerate(order.joints)} for order in orders]
    header = ("joint", "file", *(order.simulator for order in orders))
    rows = [
        (name, str(row), *(str(index_of.get(name, "-")) for index_of in indices))
        for row, name in enumerate(file_order)
    ]
    certainty = tuple("certain" if order.certain else "to be verified" for order in orders)
    return (header, *rows, ("", "", *certainty))
