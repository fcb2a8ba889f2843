"""Report cards: how far a policy gets on the tests of a map."""
