import pytest

from terrainkit import TerrainMap, generate_suite, suite_hash, suite_names, suites
from tests.tables import read_table


def test_list_prints_all_suites(terrainkit):
    run = terrainkit("suite", "list")
    assert run.returncode == 0
    assert [line.split()[0] for line in run.stdout.splitlines()] == list(suite_names())
    assert "natural-1          7 tests, 10 levels, patches of 8 m x 8 m" in run.stdout


def test_show_prints_tests_dimensions_and_hash(terrainkit):
    run = terrainkit("suite", "show", "response-1-medium")
    assert run.returncode == 0
    assert "21 tests, 10 levels, patches of 9.6 m x 2.4 m, cell 0.05 m, seed 1\n" in run.stdout
    assert f"SHA-256 {suites.get_suite('response-1-medium').sha256}\n" in run.stdout
    assert "gaps (gap_track): length 0.1 to 1, start 2.4, depth 1," in run.stdout
    assert "\nopen_stairs_40 (open_stairs): riser 0.05 to 0.2, start 2.4, tread 0.238" in run.stdout


def test_generate_writes_the_verified_map(terrainkit, rejected, tmp_path):
    run = terrainkit("suite", "generate", "natural-1", "-o", "m.npz")
    assert run.returncode == 0
    digest = suite_hash(generate_suite("natural-1"))
    assert run.stdout.endswith(f"verified: SHA-256 {digest}\n")
    assert suite_hash(TerrainMap.load(tmp_path / "m.npz")) == digest
    assert "m.npz" in rejected("suite generate natural-1 -o m.npz")


@pytest.mark.parametrize(("words", "message"), read_table(__file__, "invalid_arguments"))
def test_invalid_arguments_are_one_line(rejected, tmp_path, words, message):
    assert message in rejected(f"suite {words}")
    assert not list(tmp_path.iterdir())
