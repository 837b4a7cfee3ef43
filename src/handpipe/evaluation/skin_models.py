"""Names of the models of the skin that are compared."""

SIMULATED_MODELS = {  # those of Zheng 2022 Table 4
    "m0": "m0: full model",
    "m1": "m1: without plastic strains in the fat",
    "m2": "m2: one soft tissue",
}
SKIN_MODELS = SIMULATED_MODELS | {
    "m3": "m3: one soft tissue with plastic strains (Ichim 2017)",
    "dual_quaternion": "skinning by dual quaternions",
    "linear": "linear skinning",
    "pivot": "dual quaternions on a pivot rig",
}
