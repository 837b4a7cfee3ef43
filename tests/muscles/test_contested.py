"""Which vertices of overlapping muscles bones go on holding."""

import numpy as np
from tests.muscles.shapes import *  # noqa: F403

