"""The kinematic arm: the model file loaded, scaled and flattened for compiled code."""
