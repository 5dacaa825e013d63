"""The house keeps its rules: lazy imports, a whole wheel, no stray packages."""

import subprocess
import sys
import sysconfig
import time
import zipfile
from pathlib import Path

import pytest

ROOT = Path(__file__).resolve().parents[1]
PACKAGES = {"nat2024", "nat2024_trackers", "nat2024_enhancers", "nat2024_reports"}


def python(code: str) -> str:
    command = [sys.executable, "-c", code]
    return subprocess.run(command, check=True, capture_output=True, text=True).stdout.strip()


@pytest.mark.parametrize(
    "code",
    [
        "import nat2024",
        "import nat2024; nat2024.list_trackers(); nat2024.list_enhancers()",
        "import nat2024; nat2024.read_boxes, nat2024.evaluate_boxes",
        "import nat2024.registry as r; [r.load_plugin(n, 'enhancer') for n in r.list_enhancers()]",
        "import nat2024.registry as r; [r.load_plugin(n, 'tracker') for n in r.list_trackers()]",
        "import nat2024.datasets, nat2024.store, nat2024.evaluation, nat2024_reports",
        "from nat2024.cli import run; run(['run', '--help'])",
    ],
)
def test_heavy_libraries_load_only_when_needed(code: str) -> None:
    heavy = "{'torch', 'cv2', 'pandas', 'matplotlib'}"
    assert python(f"{code}\nimport sys; print(sorted({heavy} & set(sys.modules)))").endswith("[]")


def test_scoring_never_loads_torch() -> None:
    code = "import nat2024_reports.tables, nat2024.evaluation, pandas, sys"
    assert python(f"{code}; print('torch' in sys.modules)") == "False"


def test_help_answers_at_once() -> None:
    command = [sys.executable, "-m", "nat2024", "--help"]
    seconds = []
    for _ in range(4):
        start = time.perf_counter()
        subprocess.run(command, check=True, stdout=subprocess.DEVNULL)
        seconds.append(time.perf_counter() - start)
    assert min(seconds) < 0.5


@pytest.fixture(scope="module")
def wheel(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """The wheel as users get it, built without network."""
    folder = tmp_path_factory.mktemp("wheel")
    options = ["--wheel", "--no-isolation", "--outdir", str(folder), str(ROOT)]
    subprocess.run([sys.executable, "-m", "build", *options], check=True, capture_output=True)
    (built,) = folder.glob("*.whl")
    return built


def test_the_wheel_holds_four_packages_and_their_data(wheel: Path) -> None:
    names = zipfile.ZipFile(wheel).namelist()
    tops = {name.split("/")[0] for name in names if ".dist-info" not in name}
    assert tops == PACKAGES
    for package in PACKAGES:
        assert f"{package}/py.typed" in names
    assert "nat2024_enhancers/ldenhancer/card.toml" in names
    assert "nat2024/datasets/facts/nat2024_2.json" in names
    assert "nat2024/datasets/samples/night_mini.zip" in names
    assert "nat2024_reports/page/script/main.js" in names
    assert wheel.stat().st_size < 8_000_000
    assert any(name.endswith("licenses/LICENSE") for name in names)
    assert not [name for name in names if name.endswith((".pth", ".onnx", ".pt"))]


def test_everything_works_from_the_wheel_alone(wheel: Path, tmp_path: Path) -> None:
    target = tmp_path / "target"
    install = [sys.executable, "-m", "pip", "install", "--quiet", "--no-deps", "--no-index"]
    subprocess.run([*install, "--target", str(target), str(wheel)], check=True)
    assert (target / "bin" / "nat-bench").is_file()
    # -S leaves out the editable install's path file, so only the wheel can answer
    libraries = sysconfig.get_paths()["purelib"]
    environment = {"PYTHONPATH": f"{target}:{libraries}", "PATH": "", "HOME": str(tmp_path)}

    def nat_bench(*words: str) -> str:
        command = [sys.executable, "-S", str(target / "bin" / "nat-bench"), *words]
        done = subprocess.run(
            command, cwd=tmp_path, env=environment, check=True, capture_output=True, text=True
        )
        return done.stdout

    where = "import nat2024; print(nat2024.__file__)"
    code = [sys.executable, "-S", "-c", where]
    found = subprocess.run(code, env=environment, cwd=tmp_path, check=True, capture_output=True)
    assert Path(found.stdout.decode().strip()).is_relative_to(target)
    assert "run" in nat_bench("--help")
    assert "ldenhancer" in nat_bench("list", "--enhancers")
    assert "uavdark135" in nat_bench("list", "--datasets")
    assert "6 sequences" in nat_bench("dataset", "info", "night_mini")
    nat_bench("dataset", "synthesize", "clip", "--frames", "4", "--sequences", "1")
    table = nat_bench("run", "--tracker", "mil", "--enhancer", "gamma", "--dataset", "clip")
    assert "protocol pysot" in table


def test_source_roots_are_no_packages() -> None:
    for root in ("trackers", "enhancers", "reports", "tests"):
        assert not (ROOT / root / "__init__.py").exists()


def test_every_decorated_plugin_has_its_entry_point() -> None:
    import re
    import tomllib

    project = tomllib.loads((ROOT / "pyproject.toml").read_text())["project"]["entry-points"]
    for kind in ("tracker", "enhancer"):
        decorated = set()
        for source in (ROOT / f"{kind}s").rglob("*.py"):
            pattern = rf'^@register_{kind}\("([a-z0-9_]+)"'
            decorated |= set(re.findall(pattern, source.read_text(), re.MULTILINE))
        assert decorated == set(project[f"nat_bench.{kind}s"])


def test_library_code_names_no_machine_and_nothing_beside_the_checkout() -> None:
    for package in ("nat2024", "trackers", "enhancers", "reports", "docs", "benchmarks"):
        for source in (ROOT / package).rglob("*.py"):
            text = source.read_text()
            assert "/work/" not in text, source
            assert "/root/" not in text, source
    for package in ("nat2024", "trackers", "enhancers", "reports"):
        for source in (ROOT / package).rglob("*.py"):
            assert "shared/" not in source.read_text(), source
