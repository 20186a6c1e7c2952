"""Arrays of any shape as the flat ones that Rust takes, and JSON as arrays."""

import json
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

Floats = NDArray[np.float64]


def vectors(name: str, given: ArrayLike, length: int = 3) -> tuple[Floats, tuple[int, ...]]:
    """Flat, and the shape before the last axis, which has ``length`` numbers."""
    array = np.asarray(given, dtype=np.float64)
    if array.ndim == 0 or array.shape[-1] != length:
        raise ValueError(f"{name} has shape {array.shape}, need {length} numbers along the last axis")
    return np.ascontiguousarray(array).reshape(-1), array.shape[:-1]


def together(*columns: tuple[str, ArrayLike, int]) -> tuple[Floats, tuple[int, ...]]:
    """Vectors of several names side by side, where their shapes agree or can be made to."""
    arrays = []
    for name, given, length in columns:
        flat, shape = vectors(name, given, length)
        arrays.append(flat.reshape(*shape, length))
    shape = np.broadcast_shapes(*(array.shape[:-1] for array in arrays))
    side_by_side = np.concatenate([np.broadcast_to(array, shape + array.shape[-1:]) for array in arrays], axis=-1)
    return np.ascontiguousarray(side_by_side).reshape(-1), shape


def scalars(*given: ArrayLike) -> tuple[Floats, tuple[int, ...]]:
    """Numbers of several names side by side."""
    arrays = np.broadcast_arrays(*(np.asarray(array, dtype=np.float64) for array in given))
    return np.ascontiguousarray(np.stack(arrays, axis=-1)).reshape(-1), arrays[0].shape


def body(fields: dict[str, Any]) -> str:
    """JSON of fields in which arrays are lists; a field that is ``None`` is left out."""
    given = {name: value for name, value in fields.items() if value is not None}
    return json.dumps(given, default=plain, allow_nan=False)


def plain(value: Any) -> Any:
    """What JSON has, of what numpy has."""
    if isinstance(value, np.ndarray):
        return value.tolist()
    if isinstance(value, np.generic):
        return value.item()
    raise TypeError(f"{value!r} is nothing that a request may hold")


def arrays(value: Any) -> Any:
    """An answer with its lists of numbers as arrays; ``null`` among numbers is NaN."""
    if isinstance(value, dict):
        return {name: arrays(part) for name, part in value.items()}
    if not isinstance(value, list):
        return value
    parts = [arrays(part) for part in value]
    if parts and all(isinstance(part, float | int | None) and not isinstance(part, bool) for part in parts):
        return np.array([np.nan if part is None else part for part in parts], dtype=np.float64)
    if parts and all(isinstance(part, np.ndarray) for part in parts) and len({part.shape for part in parts}) == 1:
        return np.stack(parts)
    return parts
