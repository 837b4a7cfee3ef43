"""Figures of templates: upper envelopes of many functions, a hand carried to another by feature points."""
