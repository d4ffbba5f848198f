"""Write a file with every dtype by PyPI's safetensors. Usage: write_safetensors.py FILE"""

import sys

import numpy as np
from safetensors.numpy import save_file

tensors = {
    "F64": np.array([np.nan, np.inf, -np.inf, -0.0, 5e-324, 1 / 3]),
    "F32": np.array([[3.4028235e38, 1e-45, 0.1], [-1, 2, 3]], dtype=np.float32),
    "F16": np.array([65504, 6e-8, -0.1, np.inf, -np.inf, -0.0], dtype=np.float16),
    "I8": np.array([-128, 127], dtype=np.int8),
    "I16": np.array([-(2**15), 2**15 - 1], dtype=np.int16),
    "I32": np.array([-(2**31), 2**31 - 1], dtype=np.int32),
    "I64 small": np.array([-(2**31) + 1, -1, 0, 2**31 - 1], dtype=np.int64),
    "I64 middle": np.array([1 - 2**53, -(2**31), 2**32 - 1, 2**53 - 1], dtype=np.int64),
    "U8": np.arange(24, dtype=np.uint8).reshape(2, 3, 4),
    "U16": np.array([0, 65535], dtype=np.uint16),
    "U32": np.array([0, 2**31, 2**32 - 1], dtype=np.uint32),
    "U64": np.array([2**32, 2**53 - 1], dtype=np.uint64),
    "BOOL": np.array([[True], [False]]),
    "scalar": np.array(7, dtype=np.int64),
    "empty/é": np.zeros((0, 3), dtype=np.float32),
}
save_file(tensors, sys.argv[1], metadata={"format": "np", "said": 'a "quote"}'})
