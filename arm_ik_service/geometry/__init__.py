"""Rotations and poses. Quaternions are x y z w, vectors metres, poses (7,) x y z qx qy qz qw, axes right-handed.

`scalar` works on tuples inside compiled code, one value at a time; `batch` on numpy arrays with any leading shape.
"""
