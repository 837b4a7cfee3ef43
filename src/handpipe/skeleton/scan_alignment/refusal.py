"""Scans that are of another hand or of another pose: refused, with what was measured."""

from __future__ import annotations

from pathlib import Path

from handpipe.core import InputError
from handpipe.skeleton.scan_alignment.alignment import Alignment
