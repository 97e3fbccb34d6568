"""How everything between decode and encode is compiled, and how its state is laid out.

numba caches what it compiles by the file of the function alone, but a function has all that it calls compiled into it.
So the cache is told of every compiled source of the package: after an update, or an edit, nothing old is run.

Every stage is a small function of scalars, tuples and records. `NUMBA_DISABLE_JIT=1` runs the same code as plain
Python.
"""

from __future__ import annotations

from collections.abc import Callable
from functools import cache, cached_property
from hashlib import sha256
from pathlib import Path
from typing import Any, TypeVar, cast

import numba
import numpy as np
from filelock import FileLock
from numba.core.codegen import JITCodeLibrary
from numba.core.compiler import Compiler
from numba.core.registry import CPUDispatcher

Function = TypeVar("Function", bound=Callable[..., Any])
Record = Any  # a numpy record: attribute access in compiled code and, as `np.record`, in plain Python too


class _Library(JITCodeLibrary):
    """LLVM code that is only ever linked into other code: neither optimised for itself nor made into machine code."""

    def _optimize_final_module(self) -> None:
        pass

    def _finalize_final_module(self) -> None:
        self._finalize_dynamic_globals()  # type: ignore[no-untyped-call]
        self._finalized = True

    def get_pointer_to_function(self, name: str) -> int:
        self._ensure_finalized()  # type: ignore[no-untyped-call]
        return 0

    @property
    def codegen(self) -> Any:
        return _NoEnvironments(self._codegen)


class _NoEnvironments:
    """A codegen that leaves alone what Python objects a function refers to: none, for ours know no Python objects."""

    def __init__(self, codegen: Any) -> None:
        self._codegen = codegen

    def __getattr__(self, name: str) -> Any:
        return getattr(self._codegen, name)

    def set_env(self, name: str, environment: Any) -> None:
        pass


class _PartCompiler(Compiler):
    def __init__(self, typing: Any, target: Any, _library: Any, *rest: Any) -> None:
        library = _Library(target.codegen(), "part")  # type: ignore[no-untyped-call]
        super().__init__(typing, target, library, *rest)  # type: ignore[no-untyped-call]


class _Part(CPUDispatcher):
    """A function as it is compiled into others. From Python it runs as Python."""

    def __init__(self, function: Any, *, inline: bool = False) -> None:
        super().__init__(function, targetoptions=_options(part=True, inline=inline), pipeline_class=_PartCompiler)

    def __call__(self, *arguments: Any) -> Any:
        return self.py_func(*arguments)


class _Entry(CPUDispatcher):
    """A function as Python calls it; compiled code that calls it gets the part.

    With that what compiled code is made of is compiled once and without all that an entry takes: the first start takes
    half as long.
    """

    def __init__(self, function: Any) -> None:
        super().__init__(function, targetoptions=_options())
        _cached(self)

    @cached_property
    def part(self) -> Any:
        return _Part(self.py_func)

    def get_call_template(self, args: Any, kws: Any) -> Any:
        return self.part.get_call_template(args, kws)

    def get_overload(self, sig: Any) -> Any:
        return self.part.get_overload(sig)


def compiled(function: Function) -> Function:
    """Compile `function` with numba on first use: cached on disk, GIL released, IEEE division as numpy does it."""
    return function if _as_python() else cast(Function, _Entry(function))


def inlined(function: Function) -> Function:
    """Compile `function` into whatever calls it: for small ones of the hot loop, so that tuples stay in registers.

    From Python it runs as Python.
    """
    return function if _as_python() else cast(Function, _Part(function, inline=True))


def was_cached(function: Callable[..., Any]) -> bool:
    """Whether a compiled function that was called had been compiled before: by another process, or an earlier one."""
    return _as_python() or bool(cast(Any, function).stats.cache_hits)


def _as_python() -> bool:
    return bool(cast(Any, numba.config).DISABLE_JIT)


def _options(*, part: bool = False, inline: bool = False) -> dict[str, Any]:
    """Return numba's options, none left out: a function inherits those from whoever happens to call it first."""
    return {
        "nopython": True,
        "nogil": True,
        "error_model": "numpy",
        "forceinline": inline,
        "no_cpython_wrapper": part,
        "no_cfunc_wrapper": True,
    }


def _cached(dispatcher: Any) -> None:
    """Let a dispatcher cache on disk, under the digest of all sources, and several processes share what it cached."""
    dispatcher.enable_caching()
    index = dispatcher._cache._cache_file
    index._source_stamp = (index._source_stamp, _sources())
    _one_at_a_time(index)


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
