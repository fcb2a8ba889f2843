"""The robot spec, robot.toml: what training needs to know of a robot."""
