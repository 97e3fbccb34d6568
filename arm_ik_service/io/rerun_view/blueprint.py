"""How the viewer is laid out: the people large at the left, their plots at the right, nothing else open."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
import rerun.blueprint as rrb
from rerun.blueprint import archetypes

from arm_ik_service.geometry import batch
from arm_ik_service.io.rerun_view.rows import ANGLES
from arm_ik_service.wire.messages import Pose, Vector

WINDOW_S = 5.0  # what a plot shows, up to the time cursor
WINDOW_FRAMES = 450  # the same on the timeline `frame`, at 90 Hz
LEGEND_HEIGHT = 0.075
HALF_BODY_M = 0.85

Views = list["rrb.View | rrb.Container"]


def eye_in_front_of(
    chests: Sequence[Pose], follow: str | None = None, *, whole: bool = False
) -> archetypes.EyeControls3D:
    """Look at all of these people from where they face, a little from above and from their left.

    At the `whole` of them, or at what is above the hips. The eye goes along with the entity `follow`.
    """
    positions = [chest.position for chest in chests]
    middle = tuple(0.5 * (min(p[k] for p in positions) + max(p[k] for p in positions)) for k in range(3))
    spread = max(abs(p[k] - middle[k]) for p in positions for k in (0, 2))
    forward = batch.rotate([chest.orientation for chest in chests], (0.0, 0.0, -1.0)).mean(axis=0)
    forward[1] = 0.0
    forward = batch.normalized(forward if float(forward @ forward) > 1e-6 else (0.0, 0.0, -1.0))
    left = (forward[2], 0.0, -forward[0])
    distance = (2.1 if whole else 1.40) + 1.25 * spread
    aside, above = (0.22, 0.28) if len(chests) == 1 else (0.08, 0.4)  # a group is seen best over its heads
    position = [middle[k] + distance * forward[k] + aside * distance * left[k] for k in range(3)]
    position[1] = middle[1] + above * distance
    return archetypes.EyeControls3D(
        kind=rrb.Eye3DKind.Orbital,
        position=position,
        look_target=_raised(middle, -0.5 if whole else -0.14),
        eye_up=(0.0, 1.0, 0.0),
        tracking_entity=follow,
    )


def eye_beside(places: Sequence[Vector]) -> archetypes.EyeControls3D:
    """Look at all of these places, the first of which somebody leaves for the others, from their right and ahead."""
    points = np.array(places)
    low, high = points.min(axis=0), points.max(axis=0)
    middle = np.array([0.5 * (low[0] + high[0]), HALF_BODY_M, 0.5 * (low[2] + high[2])])
    legs = (points - points[0]) * [1.0, 0.0, 1.0]
    way = legs[np.linalg.norm(legs, axis=1).argmax()]
    span = float(np.linalg.norm(way))
    ahead = way / span if span > 0.1 else np.array([0.0, 0.0, -1.0])
    right = np.array([-ahead[2], 0.0, ahead[0]])
    distance = 1.9 + 0.65 * span
    position = middle + distance * (0.82 * right + 0.5 * ahead + [0.0, 0.28, 0.0])
    return archetypes.EyeControls3D(
        kind=rrb.Eye3DKind.Orbital, position=position, look_target=middle, eye_up=(0.0, 1.0, 0.0)
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


def _everybody(roots: Sequence[str]) -> rrb.Container:
    """Who is lost, who is late, whose hands are off: all avatars in one plot each."""

    def plot(what: str, name: str) -> rrb.TimeSeriesView:
        return rrb.TimeSeriesView(
            contents=[f"/{root}/plots/{what}" for root in roots],
            name=name,
            time_ranges=_window(),
            plot_legend=rrb.PlotLegend(visible=False),
        )

    tracking = rrb.StateTimelineView(
        contents=[f"/{root}/plots/tracking/**" for root in roots], name="tracking", time_ranges=_window()
    )
    return rrb.Vertical(
        tracking,
        plot("residual_mm", "hand residuals [mm]"),
        plot("latency_ms", "latencies [ms]"),
        row_shares=[2.4, 1.0, 1.0],
        name="everybody",
    )


def blueprint_of(
    roots: dict[str, str],
    chests: Sequence[Pose],
    followed: str | None = None,
    *,
    whole: bool = False,
    stage: Sequence[Vector] = (),
) -> rrb.Blueprint:
    """Lay out the avatars `roots`: id -> entity; `chests` are where they are now, for the eye.

    One avatar has its plots beside it, and the eye goes along with the entity `followed`. Many stand in one wide
    picture; beside it is a tab for what concerns everybody, and one for each. Where something is to happen between the
    places of a `stage`, the eye stands still and sees all of them.
    """
    eye = eye_beside(stage) if stage else eye_in_front_of(chests, followed, whole=whole)
    people = rrb.Vertical(
        rrb.Spatial3DView(
            origin="/",
            contents="/**",
            name="arms",
            eye_controls=eye,
            background=archetypes.Background(color=(24, 27, 33)),
            line_grid=archetypes.LineGrid3D(visible=True, spacing=0.5, stroke_width=0.5, color=(150, 160, 180, 60)),
        ),
        rrb.TextDocumentView(origin="/legend", name="legend", titlebar=False),
        row_shares=[1.0 - LEGEND_HEIGHT, LEGEND_HEIGHT],
    )
    plots = [_plots(root, name) for name, root in roots.items()]
    one = len(plots) == 1
    return rrb.Blueprint(
        rrb.Horizontal(
            people,
            plots[0] if one else rrb.Tabs(_everybody(list(roots.values())), *plots),
            column_shares=[1.25 if one else 2.0, 1.0],
        ),
        rrb.TimePanel(state="collapsed", timeline="sample_time"),
        rrb.BlueprintPanel(state="hidden"),
        rrb.SelectionPanel(state="hidden"),
        auto_views=False,
        auto_layout=False,
    )
