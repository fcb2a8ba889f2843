"""Read URDF, xacro and MJCF files into a RobotModel."""
