"""The stages of a build: one function a stage, files in and files out, which rules and people call.

A stage takes a record of its input files (`Inputs`), a record of its output files (`Outputs`) or the path of
its only one, the subject's dataset, and settings. No stage knows Snakemake. These packages export nothing: a
rule depends on the code of its own stage alone.
"""
