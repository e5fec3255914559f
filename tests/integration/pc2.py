#!/usr/bin/python3
"""Print what a point cache (.pc2) holds, as JSON: header and samples.   pc2.py FILE.pc2"""
import json
import struct
import sys

with open(sys.argv[1], "rb") as f:
    data = f.read()
magic, version, points, start, rate, samples = struct.unpack_from("<12siiffi", data)
values = struct.unpack(f"<{(len(data) - 32) // 4}f", data[32:])
print(json.dumps({"magic": magic.decode("latin-1"), "version": version, "points": points, "start": start, "rate": rate,
                  "samples": samples, "bytes": len(data), "values": values}))
