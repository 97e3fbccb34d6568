"""The skinned arm: a mesh with weights that follows the published bones.

`load` reads an avatar file or the built-in arms, `puppet` moves it, `blend` is the skinning itself.
"""
