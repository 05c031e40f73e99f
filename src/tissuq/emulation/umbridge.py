"""A forward model behind an UM-Bridge server, in whatever language, on whatever machine."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from functools import lru_cache
from itertools import islice
from typing import Any

import numpy as np
from numpy.typing import NDArray

from tissuq.emulation.forward import Forward
from tissuq.errors import InputError

__all__ = ["DEFAULT_URL", "UmbridgeForward"]

FloatArray = NDArray[np.float64]

DEFAULT_URL = "http://localhost:4242"


@dataclass(frozen=True)
class UmbridgeForward(Forward):
    """A model that an UM-Bridge server offers.

    The parameters are sent in the order of their priors, as one input vector or as several that together are as long;
    all output vectors together are the outputs at the measured controls. The controls are sent, too, as the entry
    ``control`` of the configuration: a server may compute there, and ignores it otherwise.

    Parameters
    ----------
    url : str
        Of the server.
    model : str
        Its name there.

    References
    ----------
    Seelinger et al. (2023), Journal of Open Source Software 8(83), 4748.
    """

    url: str = DEFAULT_URL
    model: str = "forward"

    def run(self, parameters: Mapping[str, float], control: FloatArray) -> Any:
        settings, values = {"control": control.tolist()}, iter(parameters.values())
        client, sizes = _connected(self.url, self.model)
        inputs = [list(islice(values, size)) for size in sizes]
        return np.concatenate([np.asarray(each, dtype=np.float64) for each in client(inputs, settings)])

    @property
    def identity(self) -> str:
        return f"{self.model} at {self.url}"

    @property
    def name(self) -> str:
        return f"{self.model} at {self.url}"

    def check(self, symbols: Sequence[str]) -> None:
        _, sizes = _connected(self.url, self.model)
        if sum(sizes) != len(symbols):
            raise InputError(
                f"the model '{self.model}' at {self.url} takes {sum(sizes)} parameters; {len(symbols)} have priors "
                f"({', '.join(symbols)})."
            )


@lru_cache
def _connected(url: str, model: str) -> tuple[Any, tuple[int, ...]]:
    """Return the client of a model, and the lengths of its input vectors."""
    try:
        import umbridge
    except ImportError as error:
        raise InputError("an UM-Bridge model needs its client: install tissuq with its extra 'umbridge'.") from error
    try:
        known = umbridge.supported_models(url)
    except Exception as error:  # whatever the network, the server and its answer do
        raise InputError(f"no UM-Bridge server answers at {url} ({type(error).__name__}). Start it first.") from error
    if model not in known:
        raise InputError(f"the server at {url} has no model '{model}'; it has {', '.join(known)}.")
    client = umbridge.HTTPModel(url, model)
    return client, tuple(client.get_input_sizes())
