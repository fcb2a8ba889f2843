"""Rules on how simulators load the robot (SIM)."""
