"""Does it really walk? What a trained walker or a baseline does, measured: its gait passport."""

from typing import TYPE_CHECKING

from coachable.foundation.lazy import lazily

if TYPE_CHECKING:
    from coachable.verification.certificate.file import recheck as recheck
    from coachable.verification.falsification import load_counterexample as load_counterexample
    from coachable.verification.passport import Passport as Passport
    from coachable.verification.passport import Subject as Subject
    from coachable.verification.passport import baseline_subject as baseline_subject
    from coachable.verification.passport import lane_subject as lane_subject
    from coachable.verification.passport import read_passport as read_passport
    from coachable.verification.passport.verify import verify as verify

_HOMES = {
    "Passport": "verification.passport",
    "Subject": "verification.passport",
    "baseline_subject": "verification.passport",
    "lane_subject": "verification.passport",
    "load_counterexample": "verification.falsification",
    "read_passport": "verification.passport",
    "recheck": "verification.certificate.file",
    "verify": "verification.passport.verify",
}

__all__ = sorted(_HOMES)  # pyright: ignore[reportUnsupportedDunderAll]
__getattr__, __dir__ = lazily(__name__, _HOMES)
