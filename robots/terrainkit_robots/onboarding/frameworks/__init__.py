"""Write the configuration of a robot for a training framework."""
