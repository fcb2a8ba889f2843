"""Rules on the names of links, joints and actuators (NAM)."""
