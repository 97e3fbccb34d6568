"""The machine's monotonic clock inside compiled code, for the one promise that needs it: a time limit on a solve.

Nothing reads it unless a time limit is set, so without one a replay is bit for bit the live run.
"""

from __future__ import annotations

import sys
import time
from typing import Any

import numba
from llvmlite import ir  # type: ignore[import-untyped]
from numba.core import cgutils, types
from numba.extending import intrinsic

_CLOCK_MONOTONIC = 6 if sys.platform == "darwin" else 1


@intrinsic
def _clock_gettime(typing_context: Any) -> Any:
    """Call the C library's clock_gettime by name, so that the compiled code can be cached."""

    def generate(context: Any, builder: Any, signature: Any, arguments: Any) -> Any:
        word = ir.IntType(64)
        spec = cgutils.alloca_once(builder, ir.ArrayType(word, 2))
        kind = ir.FunctionType(ir.IntType(32), [ir.IntType(32), spec.type])
        function = cgutils.get_or_insert_function(builder.module, kind, "clock_gettime")
        builder.call(function, [ir.Constant(ir.IntType(32), _CLOCK_MONOTONIC), spec])
        zero = ir.Constant(ir.IntType(32), 0)
        seconds = builder.load(builder.gep(spec, [zero, zero]))
        rest = builder.load(builder.gep(spec, [zero, ir.Constant(ir.IntType(32), 1)]))
        return builder.add(builder.mul(seconds, ir.Constant(word, 1_000_000_000)), rest)

    return types.int64(), generate


@intrinsic
def _query_performance_counter(typing_context: Any) -> Any:
    """Windows' own: ticks of 100 ns on every machine since Windows 10."""

    def generate(context: Any, builder: Any, signature: Any, arguments: Any) -> Any:
        word = ir.IntType(64)
        ticks = cgutils.alloca_once(builder, word)
        kind = ir.FunctionType(ir.IntType(32), [ticks.type])
        builder.call(cgutils.get_or_insert_function(builder.module, kind, "QueryPerformanceCounter"), [ticks])
        return builder.mul(builder.load(ticks), ir.Constant(word, 100))

    return types.int64(), generate


if numba.config.DISABLE_JIT:  # type: ignore[attr-defined]

    def monotonic_ns() -> int:
        """Return nanoseconds of the monotonic clock."""
        return time.monotonic_ns()

else:
    _read = _query_performance_counter if sys.platform == "win32" else _clock_gettime

    @numba.njit(cache=True, nogil=True)
    def monotonic_ns() -> int:
        """Return nanoseconds of the monotonic clock."""
        return int(_read())  # type: ignore[call-arg]
