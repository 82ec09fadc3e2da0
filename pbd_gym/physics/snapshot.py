"""The state of worlds at one moment, and its bytes."""

from __future__ import annotations

import io
from dataclasses import dataclass
from typing import Any

import numpy as np


@dataclass(frozen=True)
class Snapshot:
    """The state of n worlds as plain arrays, with the fingerprint of their model.

    Attributes:
        fingerprint: `Model.fingerprint`.
        x: Positions (W, N, dim) [m].
        v: Velocities (W, N, dim) [m/s].
        grabbed: Which particles are grabbed, (W, G), or None if none can be.
    """

    fingerprint: str
    x: np.ndarray
    v: np.ndarray
    grabbed: np.ndarray | None = None

    def to_bytes(self) -> bytes:
        """Return the snapshot as an uncompressed npz archive."""
        buffer = io.BytesIO()
        parts: dict[str, Any] = {"fingerprint": np.array(self.fingerprint)}
        parts.update(x=self.x, v=self.v)
        if self.grabbed is not None:
            parts["grabbed"] = self.grabbed
        np.savez(buffer, **parts)
        return buffer.getvalue()

    @staticmethod
    def from_bytes(data: bytes) -> Snapshot:
        """Read what `to_bytes` wrote. Nothing is unpickled, so bytes of unknown origin do no harm.

        Raises:
            ValueError: If the bytes are not a snapshot.
        """
        try:
            with np.load(io.BytesIO(data), allow_pickle=False) as archive:
                parts = {name: archive[name] for name in ("fingerprint", "x", "v")}
                grabbed = archive.get("grabbed")
        except Exception as error:  # zipfile, numpy and zlib raise a dozen kinds
            raise ValueError(f"these {len(data)} bytes are not a snapshot: {error}") from error
        x, v, fingerprint = parts["x"], parts["v"], parts["fingerprint"]
        if fingerprint.dtype.kind != "U" or fingerprint.ndim != 0:
            raise ValueError("these bytes are not a snapshot: the fingerprint is not a string")
        if x.dtype not in (np.float32, np.float64) or x.dtype != v.dtype:
            raise ValueError(f"these bytes are not a snapshot: types {x.dtype} and {v.dtype}")
        if x.ndim != 3 or x.shape != v.shape:
            raise ValueError(f"these bytes are not a snapshot: shapes {x.shape} and {v.shape}")
        if grabbed is not None and (grabbed.dtype != bool or grabbed.shape[:-1] != x.shape[:1]):
            kind = f"{grabbed.dtype} {grabbed.shape}"
            raise ValueError(f"these bytes are not a snapshot: grabbed particles {kind}")
        return Snapshot(str(fingerprint), x, v, grabbed)
