"""Solvers: target in, configuration out; joint velocities; elbow comfort."""
