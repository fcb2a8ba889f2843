"""Read MJCF files with MuJoCo's parser."""
