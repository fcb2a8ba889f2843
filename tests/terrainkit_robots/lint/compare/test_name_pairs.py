import pytest

from terrainkit_robots.lint.compare.name_pairs import pair_names
from tests.tables import read_table


@pytest.mark.parametrize(
    ("first", "second", "pairs", "only_first", "only_second"),
    read_table(__file__, "names_are_paired"),
    ids=["equal", "case and suffix", "equal first", "two here", "two there", "suffix", "repeated"],
)
def test_names_are_paired(first, second, pairs, only_first, only_second):
    expected = tuple(tuple(pair.split("-")) for pair in pairs.split())
    found = pair_names(first.split(), second.split())
    assert found.pairs == expected
    assert found.renamed == tuple((a, b) for a, b in expected if a != b)
    assert found.only_first == tuple(only_first.split())
    assert found.only_second == tuple(only_second.split())
