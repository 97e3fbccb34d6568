"""How the viewer is laid out: the people large at the left, their plots at the right, nothing else open."""

from __future__ import annotations

from collections.abc import Sequence

import rerun.blueprint as rrb
from rerun.blueprint import archetypes

from arm_ik_service.geometry import batch
from arm_ik_service.io.rerun_view.rows import ANGLES
from arm_ik_service.wire.messages import Pose, Vector

WINDOW_S = 5.0  # what a plot shows, up to the time cursor
WINDOW_FRAMES = 450  # the same on the timeline `frame`, at 90 Hz
LEGEND_HEIGHT = 0.075

Views = list["rrb.View | rrb.Container"]


def eye_in_front_of(
    chests: Sequence[Pose], follow: str | None = None, *, whole: bool = False
) -> archetypes.EyeControls3D:
    """Look at all of these people from the front of the first, a little from above and from their left.

    At the `whole` of them, or at what is above the hips. The eye goes along with the entity `follow`.
    """
    positions = [chest.position for chest in chests]
    middle = tuple(sum(p[k] for p in positions) / len(positions) for k in range(3))
    spread = max(abs(p[k] - middle[k]) for p in positions for k in (0, 2))
    forward = batch.rotate(chests[0].orientation, (0.0, 0.0, -1.0))
    forward[1] = 0.0
    forward = batch.normalized(forward if float(forward @ forward) > 1e-6 else (0.0, 0.0, -1.0))
    left = (forward[2], 0.0, -forward[0])
    distance = (2.3 if whole else 1.40) + 1.6 * spread
    position = [middle[k] + distance * forward[k] + 0.22 * distance * left[k] for k in range(3)]
    position[1] = middle[1] + 0.28 * distance
    return archetypes.EyeControls3D(
        kind=rrb.Eye3DKind.Orbital,
        position=position,
        look_target=_raised(middle, -0.5 if whole else -0.14),
        eye_up=(0.0, 1.0, 0.0),
        tracking_entity=follow,
    )


def _raised(point: Sequence[float], by: float) -> Vector:
    return (point[0], point[1] + by, point[2])


def _window() -> list[rrb.VisibleTimeRange]:
    now = rrb.TimeRangeBoundary.cursor_relative
    return [
        rrb.VisibleTimeRange("sample_time", start=now(seconds=-WINDOW_S), end=now()),
        rrb.VisibleTimeRange("frame", start=now(seq=-WINDOW_FRAMES), end=now()),
    ]


def _plot(entity: str, name: str) -> rrb.TimeSeriesView:
    return rrb.TimeSeriesView(
        origin=entity,
        name=name,
        time_ranges=_window(),
        plot_legend=rrb.PlotLegend(visible=False),  # it would lie over the lines; `legend` says it once for all
    )


def _multiples(root: str, kind: str, name: str) -> rrb.Grid:
    plots: Views = [_plot(f"{root}/plots/{kind}/{angle}", angle.replace("_", " ")) for angle in ANGLES]
    return rrb.Grid(*plots, grid_columns=3, name=name)


def _plots(root: str, name: str) -> rrb.Container:
    """Every plot of one avatar."""
    return rrb.Vertical(
        rrb.Tabs(
            _multiples(root, "angles", "joint angles [deg]"),
            _multiples(root, "rates", "joint velocities [deg/s]"),
        ),
        rrb.Horizontal(
            _plot(f"{root}/plots/residual_mm", "hand residual [mm]"),
            _plot(f"{root}/plots/latency_ms", "latency [ms]"),
        ),
        rrb.StateTimelineView(origin=f"{root}/plots/tracking", name="tracking", time_ranges=_window()),
        row_shares=[3.1, 1.2, 0.9],
        name=name,
    )


def blueprint_of(roots: dict[str, str], chests: Sequence[Pose], *, whole: bool = False) -> rrb.Blueprint:
    """Lay out the avatars `roots`: id -> entity; `chests` are where they are now, for the eye.

    One avatar has its plots beside it; of many, all stand in one picture and each has a tab of plots.
    """
    followed = f"{next(iter(roots.values()))}/chest" if len(roots) == 1 else None
    people = rrb.Vertical(
        rrb.Spatial3DView(
            origin="/",
            contents="/**",
            name="arms",
            eye_controls=eye_in_front_of(chests, followed, whole=whole),
            background=archetypes.Background(color=(24, 27, 33)),
            line_grid=archetypes.LineGrid3D(visible=True, spacing=0.5, stroke_width=0.5, color=(150, 160, 180, 60)),
        ),
        rrb.TextDocumentView(origin="/legend", name="legend", titlebar=False),
        row_shares=[1.0 - LEGEND_HEIGHT, LEGEND_HEIGHT],
    )
    plots = [_plots(root, name) for name, root in roots.items()]
    beside = plots[0] if len(plots) == 1 else rrb.Tabs(*plots)
    return rrb.Blueprint(
        rrb.Horizontal(people, beside, column_shares=[1.25, 1.0]),
        rrb.TimePanel(state="collapsed", timeline="sample_time"),
        rrb.BlueprintPanel(state="hidden"),
        rrb.SelectionPanel(state="hidden"),
        auto_views=False,
        auto_layout=False,
    )
