"""Verification: an independent numeric reference, and the suite of checks that compares everything
else with it."""

from hamel.verify.records import CheckResult, Verification
from hamel.verify.suite import quick_verification, verification

__all__ = ["CheckResult", "Verification", "quick_verification", "verification"]
