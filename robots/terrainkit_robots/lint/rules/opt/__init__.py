"""Rules on the physics options of MJCF files (OPT).

Models without legs switch off gravity or contacts for good reason, such as a pendulum, so only
robots with legs are checked.
"""
