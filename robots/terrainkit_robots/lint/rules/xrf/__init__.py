"""Rules that compare the robot with another description of it, or with its robot.toml (XRF)."""
