"""Verification: an independent numeric reference, and the ladder of checks that compares everything else with it."""
