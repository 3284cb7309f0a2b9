"""Generator of the tiny torch and joblib files in this folder with torch 2.13 and joblib 1.6. The
tests read them without these packages. Run it in an environment that has both.
"""

import collections
from pathlib import Path

import joblib
import numpy as np
import torch

HERE = Path(__file__).parent
ROWS = torch.arange(6.0).reshape(2, 3)
TENSORS = {
    "rows": ROWS,
    "transposed": ROWS.T,
    "expanded": torch.full((1, 2), 0.5).expand(4, 2),
    "half": torch.tensor([1.5, -2.0]).half(),
    "brain": torch.tensor([1.5, -2.0]).bfloat16(),
    "flags": torch.tensor([True, False]),
    "unsigned": torch.tensor([1, 65535], dtype=torch.uint16),
    "inner": {"parameter": torch.nn.Parameter(torch.ones(2))},
}
PEOPLE = collections.defaultdict(dict)
PEOPLE[3] = {
    "rows": np.arange(6.0).reshape(2, 3),
    "columns": np.asfortranarray(np.arange(6.0).reshape(2, 3)),
    "number": np.float32(0.5),
    "objects": np.array([None, {"a": 1}], dtype=object),
    "tensor": ROWS,
}

torch.save(TENSORS, HERE / "torch_zip.pt")
torch.save(TENSORS, HERE / "torch_legacy.pt", _use_new_zipfile_serialization=False)
np.save(HERE / "torch_nested.npy", TENSORS)
for method in (None, "zlib", "gzip", "bz2", "xz", "lzma"):
    compress = 0 if method is None else (method, 3)
    joblib.dump(PEOPLE, HERE / f"joblib_{method or 'plain'}.pkl", compress=compress)
