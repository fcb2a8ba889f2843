"""Rules that simulate the robot in MuJoCo (DYN)."""
