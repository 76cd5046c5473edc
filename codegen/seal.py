"""The manifest's own hash, and the names of the files that a build adds to those of the targets."""

from __future__ import annotations

import hashlib
import json
from collections.abc import Mapping
from typing import Any

MANIFEST = "manifest.json"
VERIFICATION = "verification.json"  # whose summary goes into the manifest
DERIVATION = "derivation.html"


def manifest_seal(manifest: Mapping[str, Any]) -> str:
    """The hash of all that a manifest says but this hash."""
    said = {name: value for name, value in manifest.items() if name != "seal"}
    return hashlib.sha256(json.dumps(said, sort_keys=True).encode()).hexdigest()
