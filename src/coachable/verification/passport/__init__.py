"""The gait passport: everything that is known of one walker, made and shown."""

from coachable.verification.passport.closed_loop import Subject, baseline_subject, lane_subject
from coachable.verification.passport.passport import Passport, Walker, read_passport, write_passport

__all__ = [
    "Passport",
    "Subject",
    "Walker",
    "baseline_subject",
    "lane_subject",
    "read_passport",
    "write_passport",
]
