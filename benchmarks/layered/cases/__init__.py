"""The hard cases, by name."""

from __future__ import annotations

from benchmarks.layered.case import Case, by_name
from benchmarks.layered.cases import constitution, input_errors, materials, poses, repetitions

CASES: dict[str, Case] = by_name(
    [
        *poses.CASES,
        *repetitions.CASES,
        *constitution.CASES,
        *materials.CASES,
        *input_errors.CASES,
    ]
)
