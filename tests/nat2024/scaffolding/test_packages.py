"""Packages written for new plugins install, pass their own tests, and run by name."""

import os
import shutil
import subprocess
import sys
from pathlib import Path

import pytest

from nat2024.errors import DuplicatePlugin, InvalidOption, Unwritable
from nat2024.scaffolding import write_plugin_package

FORMS = [
    ("enhancer", "my_lift", False),
    ("enhancer", "my_curve", True),
    ("tracker", "my_match", False),
    ("tracker", "my_siamese", True),
]


@pytest.fixture(scope="module")
def packages(tmp_path_factory):
    """All forms, written beside each other."""
    folder = tmp_path_factory.mktemp("packages")
    for kind, name, network in FORMS:
        write_plugin_package(kind, name, folder / name, network=network)
    return folder


@pytest.fixture(scope="module")
def installed(packages, tmp_path_factory):
    """All forms, installed without network into a folder of their own; gone afterwards."""
    target = tmp_path_factory.mktemp("installed")
    command = [sys.executable, "-m", "pip", "install", "--quiet", "--no-deps", "--no-index"]
    command += ["--no-build-isolation", "--target", str(target)]
    subprocess.run([*command, *(str(packages / name) for _, name, _ in FORMS)], check=True)
    yield target
    shutil.rmtree(target)


def run(*command, cwd, target):
    environment = {**os.environ, "PYTHONPATH": str(target), "OMP_NUM_THREADS": "1"}
    return subprocess.run(
        [sys.executable, "-m", *map(str, command)],
        cwd=cwd,
        env=environment,
        capture_output=True,
        text=True,
        check=False,
    )


def test_the_packages_pass_their_own_tests(packages, installed):
    tests = [packages / name / "tests" / "test_plugin.py" for _, name, _ in FORMS]
    options = ["-q", "-p", "no:cacheprovider", "--import-mode=importlib", "-W", "error"]
    done = run("pytest", *options, *tests, cwd=packages, target=installed)
    assert done.returncode == 0, done.stdout
    assert "9 passed" in done.stdout


def test_new_plugins_run_by_name(packages, installed):
    new = ["--tracker", "my_match", "--enhancer", "none", "--enhancer", "my_lift"]
    listed = run("nat2024", "list", "my_*", cwd=packages, target=installed)
    for _, name, _ in FORMS:
        assert name in listed.stdout
    assert "broken" not in listed.stdout
    first = write_first_sequences(packages, installed)
    done = run("nat2024", "run", *new, "--dataset", first, cwd=packages, target=installed)
    assert done.returncode == 0, done.stderr
    assert "my_lift" in done.stdout
    assert (packages / "results" / first / "my_match+my_lift" / "run.json").is_file()


def write_first_sequences(folder, target):
    words = ["dataset", "synthesize", "clip", "--frames", "4", "--sequences", "1"]
    assert run("nat2024", *words, cwd=folder, target=target).returncode == 0
    return "clip"


def test_an_uninstalled_plugin_is_unknown(packages):
    done = run("nat2024", "list", "my_*", "--json", cwd=packages, target=packages / "nowhere")
    assert "my_lift" not in done.stdout


def test_what_is_written_is_tidy(packages):
    for command in (["check", "--select", "E,F,I,B,UP"], ["format", "--check"]):
        options = ["--no-cache", "--isolated", "--line-length", "100"]
        done = subprocess.run(
            [sys.executable, "-m", "ruff", *command, *options, "."],
            cwd=packages,  # outside the project, where nat2024 is somebody else's package
            capture_output=True,
            text=True,
            check=False,
        )
        assert done.returncode == 0, done.stdout + done.stderr
    for file in packages.rglob("*.toml"):
        assert "$" not in file.read_text()


@pytest.mark.parametrize("name", ["", "My", "1st", "with-dash", "../up", "a/b", "x" * 41, "class"])
def test_what_is_no_name_is_refused(tmp_path, monkeypatch, name):
    monkeypatch.chdir(tmp_path)
    with pytest.raises(InvalidOption, match="cannot name an enhancer"):
        write_plugin_package("enhancer", name)
    assert not list(tmp_path.iterdir())


def test_names_of_installed_plugins_are_refused(tmp_path):
    with pytest.raises(DuplicatePlugin, match="'gamma' is taken"):
        write_plugin_package("tracker", "gamma", tmp_path / "gamma")
    assert not list(tmp_path.iterdir())


def test_a_folder_with_something_in_it_is_left_alone(tmp_path):
    (tmp_path / "kept.txt").write_text("mine")
    with pytest.raises(Unwritable, match="is there already"):
        write_plugin_package("enhancer", "my_other", tmp_path)
    assert [path.name for path in tmp_path.iterdir()] == ["kept.txt"]


def test_an_empty_folder_is_filled_and_a_missing_parent_is_made(tmp_path):
    (tmp_path / "empty").mkdir()
    assert write_plugin_package("enhancer", "my_other", tmp_path / "empty") == tmp_path / "empty"
    assert (tmp_path / "empty" / "pyproject.toml").is_file()
    write_plugin_package("enhancer", "my_other", tmp_path / "deep" / "er")
    assert (tmp_path / "deep" / "er" / "nat_bench_my_other" / "plugin.py").is_file()
    assert sorted(path.name for path in tmp_path.iterdir()) == ["deep", "empty"]


def test_a_file_in_the_way_is_one_line(tmp_path):
    (tmp_path / "file").write_text("mine")
    with pytest.raises(Unwritable):
        write_plugin_package("enhancer", "my_other", tmp_path / "file" / "below")
    assert (tmp_path / "file").read_text() == "mine"


def test_the_default_folder_is_the_name(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    assert write_plugin_package("tracker", "my_other") == Path("my_other")
    assert (tmp_path / "my_other" / "README.md").is_file()
