"""One person in space: neck, chest, shoulders, reach, grip to wrist, lengths, and the profile that says them."""
