"""Make maps of files of heights and meshes, and of the meshes of other frameworks."""
