import subprocess
import sys

import pytest

MODULES = [
    "nat2024_trackers.siamrpnpp.plugin",
    "nat2024_trackers.siamapn.plugin",
    "nat2024_trackers.siamapnpp.plugin",
    "nat2024_trackers.hift.plugin",
    "nat2024_trackers.lpat.plugin",
    "nat2024_trackers.opencv.nano",
    "nat2024_trackers.opencv.mil",
    "nat2024_trackers.correlation.mosse",
    "nat2024_trackers.correlation.kcf",
    "nat2024_trackers.correlation.fdsst",
]


@pytest.mark.parametrize("module", MODULES)
def test_plugins_import_nothing_heavy(module):
    code = (
        f"import sys, {module}; "
        "print([m for m in ('torch', 'cv2', 'pandas', 'matplotlib') if m in sys.modules])"
    )
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True)
    assert done.stdout.strip() == "[]"
