"""The overlays, one per module. The registry lists the modules of this folder."""
