"""How everything between decode and encode is compiled, and how its state is laid out.

Every stage is a small function of scalars, tuples and records. `NUMBA_DISABLE_JIT=1` runs the same code as plain
Python.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import Any, TypeVar, cast

import numba
import numpy as np

Function = TypeVar("Function", bound=Callable[..., Any])
Record = Any  # a numpy record: attribute access in compiled code and, as `np.record`, in plain Python too


def compiled(function: Function) -> Function:
    """Compile `function` with numba on first use: cached on disk, GIL released, IEEE division as numpy does it."""
    return cast(Function, numba.njit(cache=True, nogil=True, error_model="numpy")(function))


def record_dtype(fields: list[tuple[Any, ...]]) -> np.dtype[Any]:
    """Return an aligned structured dtype whose records answer to `record.field` in compiled and in plain Python."""
    return np.dtype((np.record, np.dtype(fields, align=True)))
