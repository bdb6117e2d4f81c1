"""Signal packs: the signals of robots that many people train, read from their simulators."""

from coachable.envs.signals.pack import SIGNAL_PACKS, SignalPack, signal_pack

__all__ = [
    "SIGNAL_PACKS",
    "SignalPack",
    "signal_pack",
]
