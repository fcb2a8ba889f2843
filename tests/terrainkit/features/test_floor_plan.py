import numpy as np
import pytest

from terrainkit.features.floor_plan import CORRIDOR, STAIRWELL, sample_floor_plan


def plan_of(seed, size=(10.0, 9.0), door=1.2):
    corridor, stairwell = (2.3, 3.6), (4.3, 1.2)
    options = {"corridor": corridor, "stairwell": stairwell, "room_size": 1.8, "opened": 0.3}
    return sample_floor_plan(size, door=door, rng=np.random.default_rng(seed), **options)


def test_floor_plan_connects_all_rooms_on_1000_seeds():
    for seed in range(1000):
        plan = plan_of(seed)
        seen, queue = {CORRIDOR}, [CORRIDOR]
        for here in queue:
            neighbors = {b for door in plan.doors for b in door.rooms if here in door.rooms} - seen
            seen |= neighbors
            queue += neighbors
        assert seen == set(range(len(plan.rooms)))
        # The rooms cover the floor without overlap, and a door is within the sides of both.
        size = plan.rooms[:, 2:] - plan.rooms[:, :2]
        assert size.prod(axis=1).sum() == pytest.approx(90.0)
        assert size.min() > 1.2
        for door in plan.doors:
            place = np.array([door.x, door.y])
            for room in plan.rooms[list(door.rooms)]:
                along = 1 - door.axis
                sides = room[[door.axis, door.axis + 2]]
                assert np.isclose(place[door.axis], sides).sum() == 1
                assert room[along] + 0.6 <= place[along] + 1e-9
                assert place[along] - 1e-9 <= room[along + 2] - 0.6


def test_floor_plan_path_leads_from_the_corridor_through_doors():
    for seed in range(20):
        plan = plan_of(seed)
        for room in range(1, len(plan.rooms)):
            here = CORRIDOR
            for door, there in plan.path(room):
                assert set(door.rooms) == {here, there}
                here = there
            assert here == room
        ((door, _),) = plan.path(STAIRWELL)
        assert (door.x, door.y) == (0.6, 2.3)


def test_floor_plan_walls_are_one_where_they_are_in_line():
    plan = plan_of(3)
    (corridor, *_), lines = plan.rooms, plan.walls()
    assert [(k.start, k.end) for k in lines if k.axis and k.position == corridor[3]] == [
        (0.0, 10.0)
    ]
    assert [(k.start, k.end) for k in lines if k.axis and k.position == corridor[1]] == [
        (0.0, 10.0)
    ]
    assert [k.position for k in lines if not k.axis and k.start == 0.0] == [4.3]


def test_floor_plan_has_the_same_rooms_with_narrower_doors():
    for seed in range(50):
        assert (plan_of(seed).rooms == plan_of(seed, door=0.9).rooms).all()
