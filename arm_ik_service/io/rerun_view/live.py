"""The view of messages as they arrive: they are handed over in no time and drawn by a thread of its own."""

from __future__ import annotations

from collections import deque
from collections.abc import Callable
from contextlib import nullcontext, suppress
from threading import Event, Lock, Thread
from types import TracebackType
from typing import Self

from arm_ik_service.errors import ViewError
from arm_ik_service.io.rerun_view.view import RerunView
from arm_ik_service.wire.messages import ArmsState, ControllerFrame, Skeleton

PERIOD_S = 1 / 30  # what arrived in this time is sent together: a third of the calls at 90 Hz, and no eye sees it late
FILE_PERIOD_S = 1.0  # nobody looks at a file while it is written, and few long pieces make a file of a tenth the size
CAPACITY = 360  # answers that wait at most, 4 s of one avatar at 90 Hz; beyond it the oldest are dropped
FILE_CAPACITY = 8192  # the same where nobody looks on: what a hundred people bring in FILE_PERIOD_S
REMEMBERED = 64  # frames of an avatar that wait on for their answers; one that was overtaken never gets one


class LiveView:
    """Draws what is offered, in order, without ever making the one who offers wait.

    Nothing is sent before the viewer has taken what was sent before. Where it does not keep up, the oldest answers are
    dropped and counted, so what is seen is the newest. `offer_*` may be called from any thread, such as Zenoh's.
    Where the viewer was closed, `error` says so, `when_gone` is called, and what is offered from then on is forgotten.
    """

    def __init__(
        self,
        view: RerunView,
        *,
        period_s: float | None = None,
        capacity: int | None = None,
        when_gone: Callable[[], None] = lambda: None,
    ) -> None:
        self.shown = 0
        self.dropped = 0
        self.unpaired = 0  # answers whose frame was not seen: drawn without a target
        self.error: ViewError | None = None
        self._view = view
        self._when_gone = when_gone
        self._period_s = period_s or (PERIOD_S if view.watched else FILE_PERIOD_S)
        capacity = capacity or (CAPACITY if view.watched else FILE_CAPACITY)
        self._lock = Lock()
        self._answers: deque[ArmsState] = deque(maxlen=capacity)
        self._skeletons: list[Skeleton] = []
        self._arrived: deque[tuple[str, ControllerFrame]] = deque(maxlen=capacity)
        self._frames: dict[str, dict[int, ControllerFrame]] = {}
        self._closing = Event()
        self._thread = Thread(target=self._run, name="rerun view", daemon=True)
        self._thread.start()

    def offer_frame(self, avatar: str, frame: ControllerFrame) -> None:
        """Hand over a frame: the target of the answer with the same seq, which may come before or after."""
        with self._lock:
            self._arrived.append((avatar, frame))

    def offer_arms(self, arms: ArmsState) -> None:
        """Hand over an answer."""
        with self._lock:
            self.dropped += len(self._answers) == self._answers.maxlen
            self._answers.append(arms)

    def offer_skeleton(self, skeleton: Skeleton) -> None:
        """Hand over a description."""
        with self._lock:
            self._skeletons.append(skeleton)

    def close(self) -> None:
        """Draw what is waiting and close the view. Raises ViewError as RerunView.close does, unless `error` was set."""
        self._closing.set()
        self._thread.join()
        with suppress(ViewError) if self.error else nullcontext():
            self._view.close()

    def __enter__(self) -> Self:
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        self.close()

    def _run(self) -> None:
        try:
            while not self._closing.wait(self._period_s):
                self._draw()
                while not self._view.settled(self._period_s) and not self._closing.is_set():
                    pass
            self._draw()
        except ViewError as error:
            self.error = error
            self._when_gone()

    def _draw(self) -> None:
        with self._lock:
            skeletons, self._skeletons = self._skeletons, []
            arrived = list(self._arrived)
            answers = list(self._answers)
            self._arrived.clear()
            self._answers.clear()
        for skeleton in skeletons:
            self._view.describe(skeleton)
        for avatar, frame in arrived:
            self._frames.setdefault(avatar, {})[frame.seq] = frame
        for arms in answers:
            paired = self._frames.get(arms.avatar, {}).pop(arms.seq, None)
            self.unpaired += paired is None
            self._view.add(arms, paired)
        self.shown += len(answers)
        for waiting in self._frames.values():
            for seq in list(waiting)[: max(len(waiting) - REMEMBERED, 0)]:
                del waiting[seq]
        self._view.flush()
