"""Features that several terrains share: noise, blocks, pits, ramps, and where they are placed."""
