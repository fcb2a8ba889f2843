from terrainkit_robots.lint.compare.name_pairs import pair_names


def test_equal_names_match_in_first_order():
    pairs = pair_names(["c", "a", "b"], ["a", "c", "d"])
    assert pairs.pairs == (("c", "c"), ("a", "a"))
    assert pairs.only_first == ("b",)
    assert pairs.only_second == ("d",)
    assert pairs.renamed == ()


def test_case_and_suffix_are_ignored():
    pairs = pair_names(["FL_hip_joint", "FR_hip"], ["fl_hip", "FR_hip_joint"])
    assert pairs.pairs == (("FL_hip_joint", "fl_hip"), ("FR_hip", "FR_hip_joint"))
    assert pairs.renamed == pairs.pairs
    assert pairs.only_first == pairs.only_second == ()


def test_equal_name_has_priority():
    pairs = pair_names(["hip", "hip_joint"], ["hip_joint", "hip"])
    assert pairs.pairs == (("hip", "hip"), ("hip_joint", "hip_joint"))


def test_ambiguous_names_do_not_match():
    pairs = pair_names(["hip_joint", "Hip"], ["hip_link"])
    assert pairs.pairs == ()
    assert pairs.only_first == ("hip_joint", "Hip")
    assert pair_names(["hip"], ["hip_joint", "HIP"]).pairs == ()


def test_suffix_only_does_not_match():
    assert pair_names(["_joint"], ["_link"]).pairs == ()


def test_repeated_names_count_once():
    pairs = pair_names(["a", "a", "b"], ["a", "b", "b"])
    assert pairs.pairs == (("a", "a"), ("b", "b"))
    assert pairs.only_first == pairs.only_second == ()
