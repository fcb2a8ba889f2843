"""Turn a robot file into a folder that is ready for training."""
