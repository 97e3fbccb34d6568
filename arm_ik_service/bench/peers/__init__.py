"""Other people's solvers on the same arm, each in the configuration that its own documentation recommends.

    with_pink               stephane-caron/pink: QP on Pinocchio
    with_mink               kevinzakka/mink: QP on MuJoCo
    with_placo              Rhoban/placo: QP in C++ on Pinocchio
    with_roboticstoolbox    petercorke/robotics-toolbox-python: Levenberg-Marquardt in C++, without limits

None of them is needed to use this project: `pip install 'arm-ik-service[bench]'` brings them.
"""

from __future__ import annotations

from collections.abc import Callable
from importlib import metadata
from importlib.util import find_spec
from typing import NamedTuple

from arm_ik_service.bench.contender import Contender


class Peer(NamedTuple):
    """A solver that may or may not be installed."""

    name: str
    package: str  # on the package index
    modules: tuple[str, ...]  # what it needs to import
    contender: Callable[[str], Contender]  # takes the version

    def load(self) -> Contender | str:
        """Return it ready to be measured, or why it cannot be and how to install it."""
        if any(find_spec(module) is None for module in self.modules):
            return f"not installed: pip install {self.package}"
        try:
            return self.contender(metadata.version(self.package.split(" ")[0]))
        except (ImportError, metadata.PackageNotFoundError) as error:
            return f"cannot be imported ({error}): pip install --force-reinstall {self.package}"


def _pink(version: str) -> Contender:
    from arm_ik_service.bench.peers.with_pink import PinkRun

    return Contender("pink", version, "box", PinkRun)


def _mink(version: str) -> Contender:
    from arm_ik_service.bench.peers.with_mink import MinkRun

    return Contender("mink", version, "box", MinkRun)


def _placo(version: str) -> Contender:
    from arm_ik_service.bench.peers.with_placo import PlacoRun

    return Contender("placo", version, "box", PlacoRun)


def _roboticstoolbox(version: str) -> Contender:
    from arm_ik_service.bench.peers.with_roboticstoolbox import RoboticsToolboxRun

    return Contender("roboticstoolbox", version, "none", RoboticsToolboxRun)


PEERS = (
    Peer("pink", "pin-pink daqp", ("pink", "daqp"), _pink),
    Peer("mink", "mink", ("mink", "daqp"), _mink),
    Peer("placo", "placo", ("placo",), _placo),
    Peer("roboticstoolbox", "roboticstoolbox-python", ("roboticstoolbox",), _roboticstoolbox),
)
