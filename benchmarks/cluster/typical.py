"""`python -m benchmarks.cluster.typical`: seconds a job of each rule, for `handpipe status` before a build.

They are means over the jobs of the measured build.
"""

from __future__ import annotations

import json
from statistics import fmean

from benchmarks.cluster.measured import SUBJECT, Measured
from handpipe.cli.status import TYPICAL
from handpipe.core import artifacts


def typical(found: Measured) -> str:
    """The content of the file that is shipped: subject, commit of its build, and seconds by rule."""
    seconds = {rule: round(fmean(lengths), 1) for rule, lengths in found.rules().items()}
    return json.dumps({"subject": SUBJECT, "commit": found.commit, "seconds": seconds}, indent=0) + "\n"


def main() -> None:
    """Write the file."""
    artifacts.write_text(TYPICAL, typical(Measured.read()))


if __name__ == "__main__":
    main()
