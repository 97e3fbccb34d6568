"""Measuring a person: a profile from frames of a pose, or of someone who moves about, and how sure it is."""
