from terrainkit_robots.lint.compare.name_pairs import pair_names


def test_equal_names_belong_together_in_our_order():
    pairs = pair_names(["c", "a", "b"], ["a", "c", "d"])
    assert pairs.pairs == (("c", "c"), ("a", "a"))
    assert pairs.only_ours == ("b",)
    assert pairs.only_theirs == ("d",)
    assert pairs.renamed == ()


def test_an_ending_and_capitals_make_no_difference():
    pairs = pair_names(["FL_hip_joint", "FR_hip"], ["fl_hip", "FR_hip_joint"])
    assert pairs.pairs == (("FL_hip_joint", "fl_hip"), ("FR_hip", "FR_hip_joint"))
    assert pairs.renamed == pairs.pairs
    assert pairs.only_ours == pairs.only_theirs == ()


def test_an_equal_name_comes_first():
    pairs = pair_names(["hip", "hip_joint"], ["hip_joint", "hip"])
    assert pairs.pairs == (("hip", "hip"), ("hip_joint", "hip_joint"))


def test_where_two_would_fit_none_does():
    pairs = pair_names(["hip_joint", "Hip"], ["hip_link"])
    assert pairs.pairs == ()
    assert pairs.only_ours == ("hip_joint", "Hip")
    assert pair_names(["hip"], ["hip_joint", "HIP"]).pairs == ()


def test_an_ending_alone_is_no_name():
    assert pair_names(["_joint"], ["_link"]).pairs == ()


def test_names_that_repeat_count_once():
    pairs = pair_names(["a", "a", "b"], ["a", "b", "b"])
    assert pairs.pairs == (("a", "a"), ("b", "b"))
    assert pairs.only_ours == pairs.only_theirs == ()
