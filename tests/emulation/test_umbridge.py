"""A forward model behind an UM-Bridge server, in a process of its own."""

import socket
import subprocess
import sys
import time

import numpy as np
import pytest

import tissuq as tq
from tissuq.emulation.forward import _client
from tissuq.errors import InputError

DEPTH = np.linspace(0.05, 1.0, 12)
SERVER = """
import sys
import umbridge

class Spring(umbridge.Model):
    def __init__(self):
        super().__init__("spring")

    def get_input_sizes(self, config):
        return [1, 1]

    def get_output_sizes(self, config):
        return [12]

    def __call__(self, parameters, config):
        (k,), (b,) = parameters
        return [[k * (x + b * x**2) for x in config["control"]]]

    def supports_evaluate(self):
        return True

umbridge.serve_models([Spring()], int(sys.argv[1]))
"""


@pytest.fixture(scope="module")
def address(tmp_path_factory):
    pytest.importorskip("umbridge", reason="the UM-Bridge client (extra 'umbridge') is not installed")
    with socket.socket() as free:
        free.bind(("127.0.0.1", 0))
        port = free.getsockname()[1]
    file = tmp_path_factory.mktemp("server") / "server.py"
    file.write_text(SERVER)
    server = subprocess.Popen([sys.executable, str(file), str(port)], stdout=subprocess.DEVNULL,
                              stderr=subprocess.DEVNULL)  # fmt: skip
    try:
        for _ in range(300):
            with socket.socket() as knock:
                if knock.connect_ex(("127.0.0.1", port)) == 0:
                    break
            time.sleep(0.1)
        yield f"http://127.0.0.1:{port}"
    finally:
        server.terminate()
        server.wait()


PRIORS = {"k": tq.Uniform(0.1, 4.0), "b": tq.Uniform(0.0, 2.0)}
MEASURED = 1.5 * (DEPTH + 0.8 * DEPTH**2)


@pytest.mark.slow
def test_parameters_are_identified_through_the_server(address):
    noisy = MEASURED + 0.01 * np.random.default_rng(0).standard_normal(12)
    found = tq.calibrate(
        DEPTH, noisy, tq.UmbridgeForward(address, "spring"), PRIORS, discrepancy="none", noise_sd=0.01, runs=12
    )
    for symbol, truth in (("k", 1.5), ("b", 0.8)):
        own = found.marginals[symbol]
        assert abs(own.mean - truth) < 4 * own.sd
        assert own.sd < 0.1


def test_what_the_server_does_not_offer_is_told(address):
    with pytest.raises(InputError, match="has no model 'beam'; it has spring"):
        tq.calibrate(DEPTH, MEASURED, tq.UmbridgeForward(address, "beam"), PRIORS)
    with pytest.raises(InputError, match=r"takes 2 parameters; 1 have priors \(k\)"):
        tq.calibrate(DEPTH, MEASURED, tq.UmbridgeForward(address, "spring"), {"k": tq.Uniform(0.1, 4.0)})


def test_a_server_that_is_not_there_is_told():
    pytest.importorskip("umbridge", reason="the UM-Bridge client (extra 'umbridge') is not installed")
    with socket.socket() as free:
        free.bind(("127.0.0.1", 0))
        with pytest.raises(InputError, match="no UM-Bridge server answers at"):
            tq.calibrate(DEPTH, MEASURED, tq.UmbridgeForward(f"http://127.0.0.1:{free.getsockname()[1]}"), PRIORS)


@pytest.mark.parametrize("error", [KeyError("inputSizes"), ValueError("Expecting value: line 1 column 1")])
def test_a_server_that_does_not_tell_its_sizes_is_told(address, monkeypatch, error):
    import umbridge

    def refused(model):
        raise error

    monkeypatch.setattr(umbridge.HTTPModel, "get_input_sizes", refused)
    _client.cache_clear()
    with pytest.raises(InputError, match=r"does not say what 'spring' takes \((Key|Value)Error: .*: see its log"):
        tq.calibrate(DEPTH, MEASURED, tq.UmbridgeForward(address, "spring"), PRIORS)


def test_a_missing_client_is_told(monkeypatch):
    monkeypatch.setitem(sys.modules, "umbridge", None)
    with pytest.raises(InputError, match="extra 'umbridge'"):
        tq.calibrate(DEPTH, MEASURED, tq.UmbridgeForward("http://127.0.0.1:1"), PRIORS)
