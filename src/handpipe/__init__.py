"""From MRI volumes of one hand in several poses to an animated, layered finite-element hand."""

import hashlib
import os
import shutil
from pathlib import Path

VARIABLE = "NUMBA_CACHE_DIR"  # numba reads it when it is imported
PREFIX = "kernels-"

__version__ = "0.1.0"


def keep_kernels_apart(package: Path) -> None:
    """Keep compiled kernels by the content of all kernels of a package; a folder that a person set stays.

    Numba looks at the file of a kernel alone. It would go on with what was inlined from another file before
    that file changed, and it ends in a traceback where a cached kernel names a type that is renamed.
    """
    given = os.environ.get(VARIABLE, "")
    if given and not Path(given).name.startswith(PREFIX):
        return
    folder = package / "__pycache__" / (PREFIX + _digest(package))
    os.environ[VARIABLE] = str(folder)
    if not folder.exists():
        # Another process may have made the folder by now.
        for old in set(folder.parent.glob(f"{PREFIX}*")) - {folder}:
            shutil.rmtree(old, ignore_errors=True)


def _digest(package: Path) -> str:
    """Of the content and the places of all files that have kernels."""
    digest = hashlib.blake2b(digest_size=8)
    for file in sorted(package.rglob("*.py")):
        content = file.read_bytes()
        if b"njit" in content:
            digest.update(str(file.relative_to(package)).encode() + b"\0" + content)
    return digest.hexdigest()


keep_kernels_apart(Path(__file__).parent)
