"""Verification: an independent numeric reference, and the ladder of checks that compares everything else with it."""

from hamel.verify.ladder import quick_verification, verification
from hamel.verify.records import Check, Verification

__all__ = ["Check", "Verification", "quick_verification", "verification"]
