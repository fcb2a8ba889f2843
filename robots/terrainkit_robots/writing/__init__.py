"""Writing robots: from a description in any format to a URDF and a MJCF that every reader takes."""
