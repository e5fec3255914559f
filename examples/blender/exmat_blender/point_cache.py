"""Point caches (.pc2), as the modifier Mesh Cache reads them."""
import os
import struct

import numpy as np


def write_pc2(path, frames, start=0.0):
    """Writes positions (frames, v, 3), whole or not at all. `start` is the first frame's number."""
    frames = np.asarray(frames)
    unfinished = f"{path}.{os.getpid()}.part"
    try:
        with open(unfinished, "wb") as file:
            file.write(struct.pack("<12siiffi", b"POINTCACHE2\0", 1, frames.shape[1], start, 1.0, frames.shape[0]))
            for frame in frames:
                file.write(np.ascontiguousarray(frame, "<f4").tobytes())
        os.replace(unfinished, path)
    except BaseException:
        if os.path.exists(unfinished):
            os.remove(unfinished)
        raise
