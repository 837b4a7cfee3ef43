"""The five sequences of Zheng 2022 Table 3: frames that failed, seconds, contact and continuity."""
