"""A box around a gait that is proven to return into itself: proposed here, proven by `checker` alone."""

from importlib.util import find_spec

from coachable.foundation.errors import MissingExtraError

if find_spec("ival") is None:
    raise MissingExtraError("a certificate", "verify")
