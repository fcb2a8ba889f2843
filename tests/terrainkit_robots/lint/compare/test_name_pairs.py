import pytest

from terrainkit_robots.lint.compare.name_pairs import pair_names


@pytest.mark.parametrize(
    ("first", "second", "pairs", "only_first", "only_second"),
    [
        ("c a b", "a c d", "c-c a-a", "b", "d"),
        (
            "FL_hip_joint FR_hip",
            "fl_hip FR_hip_joint",
            "FL_hip_joint-fl_hip FR_hip-FR_hip_joint",
            "",
            "",
        ),
        ("hip hip_joint", "hip_joint hip", "hip-hip hip_joint-hip_joint", "", ""),
        ("hip_joint Hip", "hip_link", "", "hip_joint Hip", "hip_link"),
        ("hip", "hip_joint HIP", "", "hip", "hip_joint HIP"),
        ("_joint", "_link", "", "_joint", "_link"),
        ("a a b", "a b b", "a-a b-b", "", ""),
    ],
    ids=["equal", "case and suffix", "equal first", "two here", "two there", "suffix", "repeated"],
)
def test_names_are_paired(first, second, pairs, only_first, only_second):
    expected = tuple(tuple(pair.split("-")) for pair in pairs.split())
    found = pair_names(first.split(), second.split())
    assert found.pairs == expected
    assert found.renamed == tuple((a, b) for a, b in expected if a != b)
    assert found.only_first == tuple(only_first.split())
    assert found.only_second == tuple(only_second.split())
