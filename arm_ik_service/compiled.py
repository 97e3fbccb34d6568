"""How everything between decode and encode is compiled, and how its state is laid out.

numba caches what it compiles by the file of the function alone, but a function has all that it calls compiled into it.
So the cache is told of every compiled source of the package: after an update, or an edit, nothing old is run.

Every stage is a small function of scalars, tuples and records. `NUMBA_DISABLE_JIT=1` runs the same code as plain
Python.
"""

from __future__ import annotations

from collections.abc import Callable
from contextlib import suppress
from functools import cache
from hashlib import sha256
from pathlib import Path
from typing import Any, TypeVar, cast

import numba
import numpy as np

Function = TypeVar("Function", bound=Callable[..., Any])
Record = Any  # a numpy record: attribute access in compiled code and, as `np.record`, in plain Python too


def compiled(function: Function, *, inline: bool = False) -> Function:
    """Compile `function` with numba on first use: cached on disk, GIL released, IEEE division as numpy does it."""
    dispatcher = numba.njit(cache=True, nogil=True, error_model="numpy", forceinline=inline)(function)
    with suppress(AttributeError):  # plain Python under NUMBA_DISABLE_JIT; a private name, should numba rename it
        index = cast(Any, dispatcher)._cache._cache_file
        index._source_stamp = (index._source_stamp, _sources())
    return cast(Function, dispatcher)


def inlined(function: Function) -> Function:
    """Compile `function` into whatever calls it: for small ones of the hot loop, so that tuples stay in registers."""
    return compiled(function, inline=True)


@cache
def _sources() -> str:
    """Return the digest of every file of the package that says how something is compiled or laid out: 5 ms."""
    digest = sha256()
    for path in sorted(Path(__file__).parent.rglob("*.py")):
        if b"arm_ik_service.compiled" in (source := path.read_bytes()):
            digest.update(source)
    return digest.hexdigest()


def record_dtype(fields: list[tuple[Any, ...]]) -> np.dtype[Any]:
    """Return an aligned structured dtype whose records answer to `record.field` in compiled and in plain Python."""
    return np.dtype((np.record, np.dtype(fields, align=True)))
