"""Bodies: the tree of links as rigid bodies, where they are, and what they touch."""
