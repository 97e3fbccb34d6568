"""Zenoh's lines in our words."""

from __future__ import annotations

from arm_ik_service.io.zenoh_log import summed_up

LINE = (
    "2026-01-02T03:04:05.678901Z {level:>5} rx-0 ThreadId({thread}) zenoh::net::routing::interceptor{where}: {text}\n"
)


def line(text: str, *, level: str = "TRACE", thread: int = 3, where: str = "::access_control") -> str:
    return LINE.format(text=text, level=level, thread=thread, where=where)


DENIED = line("Using cached result: abc1 is unauthorized to Put (ingress) on avatar/7/controllers")
INTERCEPTED = line("Msg intercepted!", where="")


def test_a_denied_message_is_counted_and_a_denial_that_was_only_looked_up_is_not() -> None:
    looked_up = line("abc1 is unauthorized to Delete (egress) on avatar/7/arms", level="DEBUG")
    said = summed_up(looked_up + (DENIED + INTERCEPTED) * 3 + DENIED)
    assert said == {"denied by access rules: Put on avatar/7/controllers from session abc1": 3}


def test_threads_are_told_apart() -> None:
    other = line("Msg intercepted!", thread=4, where="")
    assert summed_up(DENIED + other) == {}


def test_a_warning_loses_its_hint_and_everything_else_is_left_out() -> None:
    warning = line("received fatal alert: UnknownCA. Hint: increase the system open file limit.", level="WARN")
    half_a_line = DENIED[: len(DENIED) // 2]
    assert summed_up(half_a_line + "\n" + warning + line("nothing", level="INFO")) == {
        "received fatal alert: UnknownCA": 1
    }
