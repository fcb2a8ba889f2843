from dataclasses import replace

import pytest

from terrainkit.errors import ConfigError
from terrainkit.features.building_codes import check_flight, clauses
from terrainkit.features.flight import Flight
from terrainkit.terrain import presets
from terrainkit.terrains.open_stairs import OpenStairs
from terrainkit.terrains.spiral_stairs import SpiralStairs
from terrainkit.terrains.stairs import Stairs
from terrainkit.terrains.stairs_turning import StairsTurning
from tests.tables import read_table
from tests.terrains import GRID

PUBLIC = Flight(
    riser=0.178, going=0.279, number=8, width=1.2, landing=1.2, nosing=0.032, handrail=0.9
)
CODES = read_table(__file__, "codes")


@pytest.mark.parametrize(("change", "clause"), read_table(__file__, "check_flight_has_limits"))
def test_check_flight_has_limits_on_both_sides(change, clause):
    assert [each.clause for each in check_flight(replace(PUBLIC, **change), "ibc")] == clause


def test_check_flight_limits_the_step_length():
    # 2 x 0.18 m + 0.3 m is the most of EN ISO 14122-3.
    flight = replace(PUBLIC, riser=0.18, going=0.3)
    assert not check_flight(flight, "iso_14122_3")
    violated = check_flight(replace(flight, going=0.301), "iso_14122_3")
    assert [each.quantity for each in violated] == ["step_length"]
    with pytest.raises(ConfigError, match="no building code 'ifc'; there are: irc, ibc"):
        check_flight(flight, "ifc")


def test_clauses_say_where_they_were_read():
    assert {each.code for each in clauses() if not each.second_hand} >= {"osha", "aba", "wac"}
    assert all(each.second_hand for each in clauses() if each.code in ("irc", "ibc"))
    assert all(hasattr(PUBLIC, each.quantity) and each.source for each in clauses())


@pytest.mark.parametrize("preset", CODES)
def test_presets_reach_the_limit_of_their_code_and_go_beyond_it(preset):
    for difficulty in (0.0, 0.5, 1.0):
        for code in CODES[preset]:
            for stairs in presets.get_preset(preset):
                assert not check_flight(stairs.at(difficulty).flight(GRID), code)
            for stairs in presets.get_preset(preset + presets.BEYOND_CODE):
                violated = check_flight(stairs.at(difficulty).flight(GRID), code)
                assert bool(violated) == (difficulty > 0)


def test_every_stairway_describes_its_flight():
    stairs = Stairs(step_height=0.1, step_width=0.31, landing=2.0).flight(GRID)
    # 40 cells are six treads of 3 up, six down, and a top of 4.
    assert (stairs.going, stairs.number, stairs.landing) == (0.3, 6, 0.4)
    opened = OpenStairs.at(1.0).flight(GRID)
    assert (opened.number, opened.opening) == (7, pytest.approx(0.17))
    assert opened.landing == pytest.approx(0.5)
    turning = StairsTurning(tread=0.28, landing=1.2).flight(GRID)
    assert (turning.going, turning.width, turning.number) == (0.3, 1.2, 5)
    # A tread of 0.225 m at 0.9 m is 0.25 rad, so that the 25th of them is above the first.
    spiral = SpiralStairs(riser=0.2, tread=0.225, number=30, thickness=0.05).flight(GRID)
    assert spiral.headroom == pytest.approx(25 * 0.2 - 0.05)
