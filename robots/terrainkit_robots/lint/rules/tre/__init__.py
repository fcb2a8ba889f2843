"""Rules on the kinematic tree of links and joints (TRE)."""
