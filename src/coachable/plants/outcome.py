"""How a control step can end."""

import enum


class Outcome(enum.IntEnum):
    """How a control step ended; everything but `WALKING` ends an episode as a fall."""

    WALKING = 0
    FELL = 1
    CHATTERED = 2
    NOT_FINITE = 3

    @property
    def sentence(self) -> str:
        """The outcome in words."""
        return _SENTENCES[self]


_SENTENCES = {
    Outcome.WALKING: "The walker is up.",
    Outcome.FELL: "The walker fell: its hip came down to the ground.",
    Outcome.CHATTERED: "The feet chattered: too many touchdowns in too short a time.",
    Outcome.NOT_FINITE: "The state left the finite numbers; the last finite one is kept.",
}
