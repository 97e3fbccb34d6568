"""Several solvers' arms in one picture: a stick arm a solver, each in its own colour, beside the target's axes.

Below `<session>/<side>/`: `<solver>`, the arm from shoulder over elbow to wrist; `target`, the hand asked for;
`residual_mm/<solver>`, how far the hand is off. Timeline `frame`.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import NamedTuple
from uuid import uuid4

import numpy as np
import numpy.typing as npt
import rerun as rr
import rerun.blueprint as rrb

from arm_ik_service.errors import ViewError
from arm_ik_service.io.rerun_view.sinks import Save, attach, first_line
from arm_ik_service.io.rerun_view.solids import Colour

Floats = npt.NDArray[np.float64]

APPLICATION = "arm_ik_bench"
# Okabe & Ito's palette (2008), told apart by the colour-blind too; it comes round again after eight
COLOURS: tuple[Colour, ...] = (
    (230, 159, 0),
    (86, 180, 233),
    (0, 158, 115),
    (240, 228, 66),
    (0, 114, 178),
    (213, 94, 0),
    (204, 121, 167),
    (170, 170, 170),
)
RECORDED_COLOUR: Colour = (255, 255, 255)
RADIUS_M = 0.007  # thin: lines are opaque, and a dozen arms share one hand
AXIS_M = 0.08


class Ghosts(NamedTuple):
    """One arm along N frames, as each solver has it; world axes [m]."""

    session: str
    side: str
    shoulder: Floats  # (N, 3)
    target: Floats  # (N, 7)
    elbow: Mapping[str, Floats]  # by solver (N, 3)
    wrist: Mapping[str, Floats]
    residual_m: Mapping[str, Floats]  # (N,); a recorded arm has none


def write_ghosts(path: Path, arms: Sequence[Ghosts], *, recorded: str = "") -> None:
    """Write all arms of all solvers to an .rrd; the solver named `recorded` is drawn white. Raises ViewError."""
    names = list(dict.fromkeys(name for arm in arms for name in arm.elbow))
    others = [name for name in names if name != recorded]
    colours = {name: COLOURS[i % len(COLOURS)] for i, name in enumerate(others)} | {recorded: RECORDED_COLOUR}
    recording = rr.RecordingStream(APPLICATION, recording_id=uuid4(), send_properties=True)
    attach(recording, [Save(path)])
    try:
        recording.log("/", rr.ViewCoordinates.RIGHT_HAND_Y_UP, static=True)
        for arm in arms:
            _log_arm(recording, arm, colours)
        recording.send_blueprint(_blueprint(list(dict.fromkeys(arm.session for arm in arms))))
        recording.flush()
    except RuntimeError as error:
        raise ViewError(f"{path}: the picture cannot be written: {first_line(error)}") from error
    finally:
        recording.disconnect()


def _blueprint(sessions: Sequence[str]) -> rrb.Blueprint:
    """A tab a session: the arms, and below them how far each hand is off."""
    roots = {session: rr.new_entity_path([session]) for session in sessions}
    tabs = [
        rrb.Vertical(
            rrb.Spatial3DView(origin=root, name="arms"),
            rrb.TimeSeriesView(origin=root, name="hand off by [mm]"),
            row_shares=[3, 1],
            name=session,
        )
        for session, root in roots.items()
    ]
    return rrb.Blueprint(rrb.Tabs(*tabs), rrb.TimePanel(timeline="frame"), collapse_panels=True)


def _log_arm(recording: rr.RecordingStream, arm: Ghosts, colours: Mapping[str, Colour]) -> None:
    def entity(*parts: str) -> str:
        return rr.new_entity_path([arm.session, arm.side, *parts])

    time = [rr.TimeColumn("frame", sequence=np.arange(len(arm.shoulder)))]
    recording.log(entity("target"), rr.TransformAxes3D(AXIS_M), static=True)
    pose = rr.Transform3D.columns(translation=arm.target[:, :3], quaternion=arm.target[:, 3:])
    recording.send_columns(entity("target"), time, pose)
    for name, elbow in arm.elbow.items():
        style = rr.LineStrips3D.from_fields(colors=[colours[name]], radii=[RADIUS_M])
        recording.log(entity(name), style, static=True)
        points = np.stack([arm.shoulder, elbow, arm.wrist[name]], axis=1).astype(np.float32)
        recording.send_columns(entity(name), time, rr.LineStrips3D.columns(strips=list(points)))
        if name in arm.residual_m:
            plot = entity("residual_mm", name)
            recording.log(plot, rr.SeriesLines(colors=[colours[name]], names=[name]), static=True)
            recording.send_columns(plot, time, rr.Scalars.columns(scalars=1e3 * arm.residual_m[name]))
