"""Gainline: tune a vehicle's controller gains in a handful of flights."""

import gc
import os

__version__ = "0.7.0"

# Before numpy is loaded. Its matrices are small here: with threads they take several times as long, and their last bits
# depend on the number of processors.
os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")  # noqa: TID251 - no setting of ours

# Fewer garbage collections: modules being imported are never garbage, and a large response allocates several such
# portions.
gc.set_threshold(50_000)
