"""The arguments of a fit of several files: which files, their modes, specimens and noise, and tolerances of tests."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import Any

from tissuq.cli.options import once_each
from tissuq.cli.reading import resolve
from tissuq.errors import InputError

__all__ = ["files_of", "measured", "one_noise", "run_name", "tolerances"]

KINDS = ("stress", "length", "slack", "zero", "stretch")


def files_of(given: Sequence[Path]) -> list[Path]:
    """Return the files that were given; of a folder those in it that may hold measurements."""
    from tissuq.experiments.specimens import SUFFIXES

    found: list[Path] = []
    for path in given:
        if not path.is_dir():
            found.append(resolve(path))
            continue
        inside = sorted(file for file in path.iterdir() if file.suffix.lower() in SUFFIXES)
        if not inside:
            raise InputError(f"folder '{path}' has no file of measurements ({', '.join(SUFFIXES)}).")
        found += inside
    return found


def measured(
    files: Sequence[Path],
    reading: dict[str, Any],
    modes: Sequence[str] | None,
    specimens: Sequence[str] | None,
    noise_sd: str | None,
) -> dict[str, Any]:
    """Return the settings of a fit that say what was measured, of one file or of several.

    Raises
    ------
    InputError
        When there is not one mode, specimen or noise for each file, or a file does not say its mode.
    """
    from tissuq.experiments.told_mode import said_mode, told_mode

    noise = _numbers(noise_sd)
    if len(files) < 2:
        for option, every in (("--mode", modes), ("--specimen", specimens), ("--noise-sd", noise)):
            if every and len(every) > 1:
                raise InputError(f"{option} is given {len(every)} times for one file; give it once.")
        own: dict[str, Any] = {"file": str(files[0])} if files else {}
        mode = modes[0] if modes else said_mode(files[0]) if files else None
        return reading | own | {"mode": mode, "noise_sd": noise[0] if noise else None}
    modes = _for_each(files, "--mode", modes) or [told_mode(file) for file in files]
    names = _for_each(files, "--specimen", specimens)
    each_noise = _for_each(files, "--noise-sd", noise) if noise and len(noise) > 1 else None
    options = {name: value for name, value in reading.items() if value is not None}
    tests = [options | {"file": str(file), "mode": mode} for file, mode in zip(files, modes, strict=True)]
    for name, values in (("specimen", names), ("noise_sd", each_noise)):
        for test, value in zip(tests, values or [], strict=False):
            test[name] = value
    return {"tests": tests, "noise_sd": noise[0] if noise and len(noise) == 1 else None}


def tolerances(texts: Sequence[str] | None) -> dict[str, float] | None:
    """Return tolerances from texts such as ``stress=10%``; an empty one from ``none``."""
    if not texts:
        return None
    if list(texts) == ["none"]:
        return {}
    return once_each("--tolerance", map(_tolerance, texts))


def one_noise(text: str | None) -> float | str | None:
    """Return the standard deviation of the noise of all files: a number, or 'unknown'."""
    found = _numbers(text)
    if found and len(found) > 1:
        raise InputError(f"--noise-sd is given {len(found)} times for a population; give it once for all specimens.")
    return found[0] if found else None


def run_name(given: Sequence[Path], config: Path | None, sources: Sequence[Path]) -> str:
    """Return the name of a run's folder unless one is given."""
    if config is not None and len(sources) > 1:
        return config.stem
    if len(given) == 1:
        return given[0].stem
    return sources[0].stem + (f"-and-{len(sources) - 1}-more" if len(sources) > 1 else "")


def _tolerance(text: str) -> tuple[str, float]:
    name, _, number = text.partition("=")
    scale = 0.01 if number.strip().endswith("%") else 1.0
    try:
        value = float(number.strip().removesuffix("%")) * scale
    except ValueError:
        value = -1.0
    is_share = name.strip() != "zero"
    if name.strip() not in KINDS or value < 0 or (is_share and value > 1) or (not is_share and scale != 1.0):
        raise InputError(
            f"'{text}' is no tolerance; write stress=10%, length=2%, slack=0.01, zero=0.1 or stretch=0.001."
        )
    return name.strip(), value


def _numbers(text: str | None) -> list[float | str] | None:
    if text is None or text == "unknown":
        return None if text is None else [text]
    try:
        return [float(part) for part in text.split(",")]
    except ValueError as error:
        raise InputError(
            f"--noise-sd needs a number in the file's stress unit, or 'unknown', not '{text}'. For several files, one "
            "for each with commas."
        ) from error


def _for_each(files: Sequence[Path], option: str, values: Sequence[Any] | None) -> list[Any] | None:
    if not values:
        return None
    if len(values) not in (1, len(files)):
        raise InputError(f"{option} is given {len(values)} times for {len(files)} files; give it once for each.")
    return list(values) * (len(files) if len(values) == 1 else 1)
