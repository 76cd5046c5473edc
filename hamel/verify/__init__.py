"""Verification: an independent numeric reference, and the ladder of checks that compares everything else with it."""

from hamel.verify.ladder import verification
from hamel.verify.records import Check, Verification

__all__ = ["Check", "Verification", "verification"]
