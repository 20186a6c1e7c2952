"""The server that some tests ask, and numbers to draw from."""

import pathlib
import sys

import numpy as np
import pytest

ROOT = pathlib.Path(__file__).parents[2]
sys.path.insert(0, str(ROOT / "tests/python"))


def pytest_addoption(parser):
    parser.addoption("--server", required=True, help="the program teleclay-server")


@pytest.fixture
def random():
    return np.random.default_rng(11)


@pytest.fixture(scope="session")
def program(request):
    return request.config.getoption("--server")


@pytest.fixture(scope="session")
def url(program):
    """A server on ports of its own."""
    from described import running

    with running(program) as address:
        yield f"http://{address}"


@pytest.fixture
def client(url):
    import teleclay

    return teleclay.Client(url)


@pytest.fixture
def session(client, request):
    """A small session that is gone after the test."""
    name = request.node.name.lower().replace("[", "-").replace("]", "")[:64]
    block = {"shape": {"kind": "block", "size_m": [0.064, 0.064, 0.032]}, "voxel_size_m": 1e-3}
    client.create(name, scheme="force_exchange", clay=block, tool={"kind": "ball", "radius_m": 0.006})
    yield name
    client.delete(name)
