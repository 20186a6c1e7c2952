"""What surrounds the code: types, examples, and notebooks."""

import doctest
import importlib
import pathlib
import subprocess
import sys
import time

import nbformat
import pytest
from nbclient import NotebookClient

import teleclay

FOLDER = pathlib.Path(__file__).parents[1]
NOTEBOOKS = sorted((FOLDER / "notebooks").glob("*.ipynb"))


def test_types_hold():
    checked = subprocess.run(
        [sys.executable, "-m", "mypy", "--strict", "--package", "teleclay"], cwd=FOLDER, capture_output=True, text=True
    )
    assert checked.returncode == 0, checked.stdout + checked.stderr


@pytest.mark.parametrize("module", ["kinematics", "control", "clay", "sim", "client", "hand"])
def test_everything_public_says_what_it_is(module):
    """Documentation at everything public; examples in it hold."""
    module = importlib.import_module(f"teleclay.{module}")
    failed, _ = doctest.testmod(module)
    assert failed == 0
    for name, thing in vars(module).items():
        if not name.startswith("_") and getattr(thing, "__module__", None) == module.__name__ and callable(thing):
            assert thing.__doc__, name
            for part, member in vars(thing).items() if isinstance(thing, type) else []:
                if not part.startswith("_") and callable(member):
                    assert member.__doc__, f"{name}.{part}"


def test_the_package_tells_its_types():
    folder = pathlib.Path(teleclay.__file__).parent
    assert (folder / "py.typed").is_file() and (folder / "_native.pyi").is_file()


def test_there_are_three_notebooks():
    assert len(NOTEBOOKS) == 3


@pytest.mark.parametrize("file", NOTEBOOKS, ids=[file.stem for file in NOTEBOOKS])
def test_a_notebook_runs_from_top_to_bottom(file):
    notebook = nbformat.read(file, as_version=4)
    assert all(not cell.get("outputs") and cell.get("execution_count") is None for cell in notebook.cells)
    began_s = time.monotonic()
    NotebookClient(notebook, timeout=600, kernel_name="python3", resources={"metadata": {"path": str(file.parent)}}).execute()
    print(f"{file.stem}: {time.monotonic() - began_s:.0f} s")
