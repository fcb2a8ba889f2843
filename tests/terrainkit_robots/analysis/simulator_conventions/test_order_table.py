from terrainkit_robots.analysis.simulator_conventions.order_table import order_table
from tests.small_robots import facts, tree_text


def test_order_table_has_a_row_for_each_joint():
    robot = facts(tree_text("jc: b > c", "ja: b > a", "jk: c > k"))
    assert order_table(robot.file_order, robot.simulator_orders) == (
        ("joint", "file", "MuJoCo", "Isaac Gym", "Isaac Lab", "Genesis", "PyBullet"),
        ("jc", "0", "0", "1", "1", "0", "0"),
        ("ja", "1", "2", "0", "0", "2", "2"),
        ("jk", "2", "1", "2", "2", "1", "1"),
        ("", "", "certain", "to be verified", "to be verified", "certain", "certain"),
    )
