"""One person in space: neck, chest, shoulders, reach, grip to wrist, and the calibration profile."""
