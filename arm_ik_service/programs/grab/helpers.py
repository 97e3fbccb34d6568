"""Who helps an arm that is too short, in order: each gives no more than what is still missing.

The arm alone reaches what it can; then the clavicle comes forward, the trunk turns, it leans, and last the knees bend.
"""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
import numpy.typing as npt

Floats = npt.NDArray[np.float64]

PRIORITY = ("clavicle", "turn", "lean", "knees")
MOST = np.array([0.05, np.radians(35.0), np.radians(45.0), 0.40])  # [m], [rad], [rad], [m]
_LOOKS = 7  # places at which a helper's range is looked at
_HALVINGS = 8  # of the stretch between two of them


def recruit(shortfall: Callable[[Floats], float]) -> Floats:
    """Return what each of PRIORITY gives (4,), the least that will do in their order.

    `shortfall(given)` [m] is how far the hand stays from its target beyond the arm's length, not positive within it.
    A helper that cannot make up for all of it gives what helps most, and the next one is asked.
    """
    given = np.zeros(len(PRIORITY))
    for k, most in enumerate(MOST):
        if shortfall(given) <= 0.0:
            break

        def left(amount: float, k: int = k) -> float:
            trial = given.copy()
            trial[k] = amount
            return shortfall(trial)

        amounts = np.linspace(0.0, most, _LOOKS)
        missing = np.array([left(amount) for amount in amounts])
        if missing.min() > 0.0:
            given[k] = amounts[np.argmin(missing)]
            continue
        enough = int(np.argmax(missing <= 0.0))
        low, high = amounts[enough - 1], amounts[enough]
        for _ in range(_HALVINGS):
            middle = 0.5 * (low + high)
            low, high = (low, middle) if left(middle) <= 0.0 else (middle, high)
        given[k] = high
    return given
