"""Verification: an independent numeric reference, and the ladder of checks that compares everything else with it."""

from hamel.verify.records import Check, Verification
from hamel.verify.suite import quick_verification, verification

__all__ = ["Check", "Verification", "quick_verification", "verification"]
