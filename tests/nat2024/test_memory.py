"""Freed memory is kept where frames come again and again, and can be given back."""

import resource
import subprocess
import sys

import pytest

SCRIPT = """
import resource, sys
import numpy as np
from nat2024.memory import keep_freed_memory, return_freed_memory

def faults():
    return resource.getrusage(resource.RUSAGE_SELF).ru_minflt

def held():
    return int(open("/proc/self/statm").read().split()[1]) * resource.getpagesize()

if sys.argv[1] == "keep":
    keep_freed_memory()
for _ in range(3):
    np.ones(40 << 20, dtype=np.uint8)
before = faults()
for _ in range(5):
    np.ones(40 << 20, dtype=np.uint8)
kept = held()
return_freed_memory()
print(faults() - before, kept - held())
"""


@pytest.mark.skipif(sys.platform != "linux", reason="mallopt is GNU's")
def test_pages_are_taken_once_and_can_be_given_back():
    found = {}
    for mode in ("keep", "usual"):
        done = subprocess.run(
            [sys.executable, "-c", SCRIPT, mode], capture_output=True, text=True, check=True
        )
        found[mode] = [int(word) for word in done.stdout.split()]
    pages = 5 * (40 << 20) // resource.getpagesize()
    assert found["keep"][0] < 0.1 * pages
    assert found["keep"][1] > 30 << 20
    assert found["usual"][1] < 30 << 20
