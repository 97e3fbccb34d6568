"""The arms that we ship: modelled as a solid by formulas, meshed, and weighted. Nothing is stored, it takes a moment.

    python -m arm_ik_service.skin.builtin arms.glb      # to look at them elsewhere

`solid` says where the surface is, `polygonise` puts vertices on it, `arms` gives them bones. The same on every machine.
"""

from __future__ import annotations

from arm_ik_service.skin.builtin.arms import built_in_arms

__all__ = ["built_in_arms"]
