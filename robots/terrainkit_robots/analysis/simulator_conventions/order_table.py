"""The order table: each joint of the file, and its number in every simulator."""

from typing import TYPE_CHECKING

from terrainkit_robots.analysis.simulator_conventions.joint_order import (
    file_order,
    simulator_orders,
)

if TYPE_CHECKING:
    from terrainkit_robots.analysis.facts import Facts


def order_table(facts: "Facts") -> tuple[tuple[str, ...], ...]:
    """Return rows of cells: the header, one row a joint in the order of the file, and how sure.

    The numbers count from 0.
    """
    orders = simulator_orders(facts)
    places = [{name: index for index, name in enumerate(order.joints)} for order in orders]
    header = ("joint", "file", *(order.simulator for order in orders))
    rows = [
        (name, str(index), *(str(place.get(name, "-")) for place in places))
        for index, name in enumerate(file_order(facts))
    ]
    sure = tuple("certain" if order.certain else "to be verified" for order in orders)
    return (header, *rows, ("", "", *sure))
