"""Signal packs: the signals of robots that many people train, read from their simulators."""

from coachable.envs.signals.pack import SIGNAL_PACKS as SIGNAL_PACKS
from coachable.envs.signals.pack import SignalPack as SignalPack
from coachable.envs.signals.pack import signal_pack as signal_pack
