"""Types of arrays."""

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]
"""Numbers in double precision; docstrings say which shape."""
Indices = NDArray[np.intp]
Flags = NDArray[np.bool_]
