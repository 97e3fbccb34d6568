"""Who may speak for which avatar: a short code to type once, then a token that outlives restarts of the bridge."""

from __future__ import annotations

import hashlib
import hmac
import secrets
from collections import deque

CODE_DIGITS = 6
TRIES_PER_ADDRESS = 5  # wrong codes in a minute
TRIES_IN_ALL = 60  # in a minute, whatever the address: half of all codes then take six days
_MINUTE_S = 60.0


def new_code() -> str:
    """Return a code that is easy to type on a headset's keyboard."""
    return "".join(secrets.choice("0123456789") for _ in range(CODE_DIGITS))


class Pairing:
    """Checks codes and tokens. A token is the avatar id signed with the bridge's secret: nothing has to be stored."""

    def __init__(self, code: str, secret: bytes) -> None:
        self._code = code
        self._secret = secret
        self._wrong: deque[tuple[float, str]] = deque()  # time and address of the last minute's wrong codes

    def locked(self, address: str, now_s: float) -> bool:
        """Whether too many wrong codes came, from this address or in all, for another to be looked at."""
        while self._wrong and now_s - self._wrong[0][0] > _MINUTE_S:
            self._wrong.popleft()
        own = sum(1 for _, other in self._wrong if other == address)
        return own >= TRIES_PER_ADDRESS or len(self._wrong) >= TRIES_IN_ALL

    def avatar_for_code(self, code: str, address: str, now_s: float) -> str | None:
        """Return a new avatar id for a headset that knows the code; None, and counted, for a wrong one."""
        if hmac.compare_digest(code.strip().encode(), self._code.encode()):
            return f"headset-{secrets.token_hex(3)}"
        self._wrong.append((now_s, address))
        return None

    def token(self, avatar: str) -> str:
        """Return the token with which this avatar comes back."""
        return f"{avatar}.{self._signature(avatar)}"

    def avatar_for_token(self, token: str) -> str | None:
        """Return the avatar of a token that this bridge's secret signed, or None."""
        avatar, _, signature = token.rpartition(".")
        return avatar if hmac.compare_digest(signature.encode(), self._signature(avatar).encode()) else None

    def _signature(self, avatar: str) -> str:
        return hmac.new(self._secret, avatar.encode(), hashlib.sha256).hexdigest()[:32]
