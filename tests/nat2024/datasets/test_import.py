import subprocess
import sys


def test_importing_loads_nothing_heavy():
    code = (
        "import sys, nat2024.datasets as d; d.list_datasets();"
        "print([m for m in ('cv2', 'torch', 'pandas', 'matplotlib') if m in sys.modules])"
    )
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True)
    assert done.stdout.strip() == "[]"
