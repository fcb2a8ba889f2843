"""Rules on joints and actuators (JNT)."""
