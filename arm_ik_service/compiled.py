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
from filelock import FileLock
from numba.core.registry import CPUDispatcher

Function = TypeVar("Function", bound=Callable[..., Any])
Record = Any  # a numpy record: attribute access in compiled code and, as `np.record`, in plain Python too


class _Inner(CPUDispatcher):
    def __call__(self, *arguments: Any) -> Any:
        return self.py_func(*arguments)


def compiled(function: Function) -> Function:
    """Compile `function` with numba on first use: cached on disk, GIL released, IEEE division as numpy does it."""
    return cast(Function, _cached(numba.jit(cache=True, **_options())(function)))


def inner(function: Function, *, inline: bool = False) -> Function:
    """Compile `function` only as part of others: for private ones that nothing but compiled code calls.

    From Python it runs as Python: the entry from there, which numba compiles for every other function, is a sixth of
    the time of a first start.
    """
    if cast(Any, numba.config).DISABLE_JIT:
        return function
    dispatcher = _Inner(function, targetoptions=_options(inner=True, inline=inline))
    dispatcher.enable_caching()
    return cast(Function, _cached(dispatcher))


def inlined(function: Function) -> Function:
    """Compile `function` into whatever calls it: for small ones of the hot loop, so that tuples stay in registers."""
    return inner(function, inline=True)


def _options(*, inner: bool = False, inline: bool = False) -> dict[str, Any]:
    """Return numba's options, none left out: a function inherits those from whoever happens to call it first."""
    return {
        "nopython": True,
        "nogil": True,
        "error_model": "numpy",
        "forceinline": inline,
        "no_cpython_wrapper": inner,
        "no_cfunc_wrapper": True,
    }


def _cached(dispatcher: Any) -> Any:
    """Tell a dispatcher's cache of all sources, and let several processes share it."""
    with suppress(AttributeError):  # plain Python under NUMBA_DISABLE_JIT; a private name, should numba rename it
        index = dispatcher._cache._cache_file
        index._source_stamp = (index._source_stamp, _sources())
        _one_at_a_time(index)
    return dispatcher


def _one_at_a_time(index: Any) -> None:
    """Let several processes fill one cache: without a lock two that save at once can take the same file name."""
    lock = FileLock(Path(index._cache_path) / "arm_ik_service.lock", is_singleton=True)

    def locked(function: Callable[..., Any]) -> Callable[..., Any]:
        def call(*arguments: Any) -> Any:
            with lock:
                return function(*arguments)

        return call

    index.save, index.load = locked(index.save), locked(index.load)


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
