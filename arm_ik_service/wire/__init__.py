"""The messages on the bus, the bytes they travel in, and the keys they travel under."""
