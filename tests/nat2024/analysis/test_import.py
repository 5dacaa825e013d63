import subprocess
import sys


def test_analysis_imports_nothing_heavy() -> None:
    code = (
        "import sys, nat2024.analysis, nat2024.measures, nat2024_reports.figures.dataset; "
        "print(sorted({'torch', 'cv2', 'pandas', 'matplotlib'} & set(sys.modules)))"
    )
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True)
    assert done.stdout.strip() == "[]"
