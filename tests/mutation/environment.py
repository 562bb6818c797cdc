"""How the processes of a mutation run are set up."""

import os


def set_up(scratch: str) -> None:
    """Nothing compiles, no plugin but ours is loaded, and hypothesis writes into `scratch`.

    To be called before numba and numpy are imported: they read their settings then.
    """
    os.environ |= {
        "NUMBA_DISABLE_JIT": "1",
        "OPENBLAS_NUM_THREADS": "1",
        "PYTEST_DISABLE_PLUGIN_AUTOLOAD": "1",
        "HYPOTHESIS_STORAGE_DIRECTORY": scratch,
    }
