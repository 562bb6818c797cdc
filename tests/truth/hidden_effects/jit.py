"""How the kernels of the hidden flights are compiled."""

from pathlib import Path

import numpy as np

from tests.stamped import stamped

Array = np.ndarray

jitted = stamped(Path(__file__).parent, nogil=True, error_model="numpy")
"""Free of the interpreter lock, with IEEE division; kept on disk until one of the files here changes."""
