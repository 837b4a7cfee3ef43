"""Numbers and arrays in one message to the page."""

from __future__ import annotations

import json
from collections.abc import Mapping
from typing import Any

import numpy as np
from numpy.typing import NDArray


def pack(header: Mapping[str, Any], arrays: Mapping[str, NDArray]) -> bytes:
    """One message: length of the JSON as uint32, JSON, arrays of four-byte numbers, little-endian.

    The JSON's `arrays` says by name the kind ("f4" or "u4"), the place and the number of numbers. Places
    count from the end of the JSON, which is filled up to a multiple of four bytes.
    """
    index, offset = {}, 0
    for name, array in arrays.items():
        index[name] = [array.dtype.str[1:], offset, array.size]
        offset += array.nbytes
    text = json.dumps({**header, "arrays": index}).encode()
    text += b" " * (-len(text) % 4)
    parts = [np.ascontiguousarray(a, dtype=a.dtype.newbyteorder("<")).tobytes() for a in arrays.values()]
    return b"".join([np.uint32(len(text)).astype("<u4").tobytes(), text, *parts])
