"""Apply fixes to robot files."""
