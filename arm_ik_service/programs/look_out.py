"""How one of several services learns who speaks that is another's, for the day it is to take them over.

For a moment a few times a second it hears everybody, and from time to time it asks the others for the profiles of those
it heard.
"""

from __future__ import annotations

import logging
from collections.abc import Callable

from arm_ik_service.body.profile import Profile
from arm_ik_service.errors import DecodeError
from arm_ik_service.io.zenoh_inbox import Inbox
from arm_ik_service.io.zenoh_streams import Bus, query_later
from arm_ik_service.settings import ServiceSettings
from arm_ik_service.wire.codec import MapDecoder
from arm_ik_service.wire.keys import Keys

log = logging.getLogger("arm_ik.service")

# look-outs: how often the others are asked for their avatars' profiles, which may change, and how often at the most for
# those of somebody new
CALIBRATIONS_EVERY, NEW_CALIBRATIONS_EVERY = 16, 4
NEVER_S = float("inf")
profiles = MapDecoder(Profile)


class LookOut:
    """Turns hearing everybody on and off. All but `note_calibration` is called by the service's loop."""

    def __init__(
        self, bus: Bus, keys: Keys, limits: ServiceSettings, inbox: Inbox, is_served: Callable[[str], bool]
    ) -> None:
        """`is_served` tells our own avatars: their profile is not learnt from others."""
        self._bus = bus
        self._keys = keys
        self._limits = limits
        self._inbox = inbox
        self._is_served = is_served
        self._profiles: dict[str, Profile] = {}
        self._count = 0
        self._looking = False
        self.due_s = NEVER_S  # when `turn` is to be called

    def turn(self, now_s: float) -> None:
        """Begin or end a moment of hearing everybody."""
        if self._looking:
            self._inbox.end_look_out()
            self.due_s = now_s + self._limits.look_out_period_s - self._limits.look_out_s
        else:
            self._inbox.look_out()
            self.due_s = now_s + self._limits.look_out_s
            somebody_new = self._count % NEW_CALIBRATIONS_EVERY == 0 and any(
                avatar not in self._profiles for avatar in self._inbox.others()
            )
            if somebody_new or self._count % CALIBRATIONS_EVERY == 0:
                self.ask_for_calibrations()
            self._count += 1
        self._looking = not self._looking

    def begin_again(self, now_s: float) -> None:
        """The services are others now: look out at once."""
        self._inbox.end_look_out()
        self._looking, self.due_s = False, now_s

    def end(self) -> None:
        """Nobody else is there: hear everybody all the time."""
        self._inbox.end_look_out(hear_everybody=True)
        self._looking, self.due_s = False, NEVER_S

    def take_profile(self, avatar: str) -> Profile | None:
        """Return the profile that an avatar had with another service, once."""
        return self._profiles.pop(avatar, None)

    def ask_for_calibrations(self) -> None:
        """Ask all services; answers come later."""
        query_later(self._bus, self._keys.calibration(), self.note_calibration)

    def note_calibration(self, key: str, payload: bytes) -> None:
        """Run on a Zenoh thread: keep another's profile for the day its avatar is ours."""
        avatar = self._keys.avatar_of(key)
        if self._is_served(avatar) or len(self._profiles) >= 16 * self._limits.max_avatars:
            return
        try:
            self._profiles[avatar] = profiles.decode(payload)
        except DecodeError:
            log.warning("avatar %s: a calibration that cannot be read", avatar)
