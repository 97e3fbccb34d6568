"""The one progress bar of the project: frames done, rate, time left; silent where nobody looks at a terminal."""

from __future__ import annotations

import sys
from collections.abc import Callable, Iterator
from contextlib import contextmanager

from rich.console import Console
from rich.progress import BarColumn, MofNCompleteColumn, Progress, TextColumn, TimeElapsedColumn, TimeRemainingColumn


@contextmanager
def frames_progress(title: str, total: int | None) -> Iterator[Callable[[int], None]]:
    """Show a bar on standard error and yield the function that moves it on by a number of frames."""
    columns = (
        TextColumn("{task.description}"),
        BarColumn(),
        MofNCompleteColumn(),
        TextColumn("frames"),
        TimeElapsedColumn(),
        TimeRemainingColumn(),
    )
    console = Console(stderr=True)
    with Progress(*columns, console=console, disable=not sys.stderr.isatty(), refresh_per_second=5) as bar:
        task = bar.add_task(title, total=total)

        def advance(frames: int) -> None:
            bar.advance(task, frames)

        yield advance
