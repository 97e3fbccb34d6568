"""The two timelines of everything that moves: `frame` (seq) and `sample_time` (duration)."""

from __future__ import annotations

import numpy as np
import numpy.typing as npt
import rerun as rr

Integers = npt.NDArray[np.int64]


def time_columns(frames: Integers, times_ns: Integers) -> list[rr.TimeColumn]:
    """Return the times (N,) of the rows of columns."""
    return [
        rr.TimeColumn("frame", sequence=frames),
        rr.TimeColumn("sample_time", duration=times_ns.astype("timedelta64[ns]")),
    ]
