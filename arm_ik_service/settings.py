"""Every number a user may turn, with its unit in its name. Read from TOML once; frozen from then on.

`to_record` flattens one section into the numpy record that compiled code reads: numbers as they are, a choice such as
`dead_reckoning = "freeze"` as its place in the list of choices.
"""

from __future__ import annotations

from pathlib import Path
from typing import Annotated, Any, Literal, get_args, get_origin, get_type_hints

import msgspec
import numpy as np
from msgspec import Meta

from arm_ik_service.compiled import Record, record_dtype
from arm_ik_service.errors import SettingsError
from arm_ik_service.wire.messages import Encoding


class TrackingSettings(msgspec.Struct, frozen=True, forbid_unknown_fields=True):
    """One device in time."""

    # what to do with a hand whose pose is valid but not tracked (dead-reckoned): `freeze` holds it on the person as
    # where there is no pose at all, `follow` believes the guess, `fade_to_rest` lowers the arm once it is lost
    dead_reckoning: Literal["freeze", "follow", "fade_to_rest"] = "freeze"
    lost_after_s: Annotated[float, Meta(ge=0.0)] = 1.0  # without good data a device is held, after this long it is lost
    reacquire_m_s: Annotated[float, Meta(gt=0.0)] = 14.0  # speed of the way back to good data, added to the data's own:
    reacquire_rad_s: Annotated[float, Meta(gt=0.0)] = 45.0  # 0.9 m or half a turn take 0.1 s; at the least it is 0.04
    smoothing: Literal["off", "light", "strong"] = "light"  # adds 0, 0.2 or 2.5 ms to a stroke of 2 m/s


class BodySettings(msgspec.Struct, frozen=True, forbid_unknown_fields=True):
    """One person in space."""

    # part of the straight arm at which the soft reach clamp sets in; it costs 3 mm at full reach, 1 makes it a hard one
    soft_reach_from: Annotated[float, Meta(gt=0.5, le=1.0)] = 0.985
    learns: bool = True  # stature, arm lengths and how controllers sit, from the motion, where the profile is silent


class SolverSettings(msgspec.Struct, frozen=True, forbid_unknown_fields=True):
    """One arm, target to configuration."""

    iterations: Annotated[int, Meta(ge=1, le=10_000)] = 32  # a frame's budget: 0.3 us each
    time_limit_us: Annotated[float, Meta(ge=0.0)] = 0.0  # of one arm's frame; 0: iterations alone bound it
    # Far tighter than an eye needs: what is left of the error is noise in velocity and jerk, and in a smooth walk a
    # hundredth of a millimetre is as much jerk as there is. It takes an iteration more.
    position_tolerance_m: Annotated[float, Meta(gt=0.0)] = 2e-6
    orientation_tolerance_rad: Annotated[float, Meta(gt=0.0)] = 2e-5
    # the lever on which a radian of hand rotation weighs as much as a metre of position: a hand's length and a bit
    rotation_weight_m: Annotated[float, Meta(gt=0.0)] = 0.14
    # publish the arms as they will be so long after the sample time: hides the way of the messages, doubles their noise
    predict_s: Annotated[float, Meta(ge=0.0, le=0.1)] = 0.0
    swivel_speed_rad_s: Annotated[float, Meta(ge=0.0)] = 4.0  # the elbow about the arm's line, for comfort alone
    swivel_acceleration_rad_s2: Annotated[float, Meta(gt=0.0)] = 80.0  # so that joint velocities do not jump
    swivel_time_s: Annotated[float, Meta(ge=0.0)] = 0.09  # in which it covers most of the way to the comfortable place
    # what is shown follows the solve's elbow in the time in which the hand moves on by so much; 0: it is the solve's
    elbow_lag_m: Annotated[float, Meta(ge=0.0, le=1.0)] = 0.03


class ServiceSettings(msgspec.Struct, frozen=True, forbid_unknown_fields=True):
    """The bus, and what the service admits from it. Every limit is there so that one sender cannot hurt another."""

    key_prefix: str = ""  # put before every key, for several installations on one network
    encoding: Encoding = "msgpack"  # of what goes out; what comes in may be either
    max_avatars: Annotated[int, Meta(ge=1, le=100_000)] = 256  # rows are allocated at the start, about 12 KiB each
    max_message_bytes: Annotated[int, Meta(ge=512)] = 4096  # the largest honest frame is about 1 KiB, in JSON
    # of one avatar: the fastest trackers give 1000 poses a second; what comes beyond is dropped before it is decoded
    max_frames_per_s: Annotated[float, Meta(ge=1.0)] = 1000.0
    rate_burst_s: Annotated[float, Meta(ge=0.1)] = 2.0  # so many seconds' frames may come at once, after a stall
    # Wireless links that deliver several frames at once: each waits up to so long, so that they come out as they were
    # sampled. The delay this adds is the whole of it for a frame that was on time; nothing where it is 0.
    jitter_buffer_s: Annotated[float, Meta(ge=0.0, le=0.25)] = 0.0
    max_id_length: Annotated[int, Meta(ge=1, le=255)] = 64  # an id is also a file name and an entity path
    forget_after_s: Annotated[float, Meta(gt=0.0)] = 60.0  # a silent avatar gives its row back
    health_period_s: Annotated[float, Meta(ge=0.1)] = 1.0
    # while somebody speaks and nothing came for so long, a frame is solved for nobody: the next finds warm caches. It
    # takes a quarter off the round trip of one person and costs up to 5 % of a core; 0 turns it off
    rehearse_every_s: Annotated[float, Meta(ge=0.0, le=1.0)] = 0.002
    # Several services: each hears only its own avatars, and looks out for others who speak. A new avatar waits a period
    # for its first answer at the longest; the share of the others' traffic that is heard is look_out_s over the period.
    look_out_period_s: Annotated[float, Meta(ge=0.05)] = 0.25
    look_out_s: Annotated[float, Meta(ge=0.01)] = 0.04  # longer than the interval between two frames at 30 Hz
    # between saying that we are there and answering: whoever answered until then has heard it, nobody answers twice
    hand_over_s: Annotated[float, Meta(ge=0.0)] = 0.1


class Settings(msgspec.Struct, frozen=True, forbid_unknown_fields=True):
    """All of them, one TOML table a section."""

    tracking: TrackingSettings = TrackingSettings()
    body: BodySettings = BodySettings()
    solver: SolverSettings = SolverSettings()
    service: ServiceSettings = ServiceSettings()


def load_settings(path: Path | None) -> Settings:
    """Read settings from a TOML file; None gives the defaults. Raises SettingsError naming the file and the field."""
    if path is None:
        return Settings()
    try:
        return msgspec.toml.decode(path.read_bytes(), type=Settings)
    except OSError as error:
        raise SettingsError(f"settings file {path}: {error.strerror}") from error
    except (msgspec.DecodeError, UnicodeDecodeError) as error:
        raise SettingsError(f"settings file {path}: {error}") from error


def _dtype_of(hint: Any) -> Any:
    choice = get_origin(hint) is Literal
    return np.int64 if choice or hint in (int, bool) else np.float64


def section_dtype(section: type[msgspec.Struct]) -> np.dtype[Any]:
    """Return the dtype of a section's record."""
    return record_dtype([(name, _dtype_of(hint)) for name, hint in get_type_hints(section).items()])


def to_record(section: msgspec.Struct) -> Record:
    """Flatten a section of numbers and choices into one record of its field names."""
    record = np.zeros(1, section_dtype(type(section)))
    for name, hint in get_type_hints(type(section)).items():
        value = getattr(section, name)
        record[0][name] = get_args(hint).index(value) if get_origin(hint) is Literal else value
    return record[0]
