"""Register batches of 3D range scans with a visage service, and ask its gallery.

    import visage

    result = visage.register("scans/")
    print(result.quality, result.poses["bun045.ply"])

`Client` and `AsyncClient` do the same and more; `visage.core` holds every call of the service's contract.
"""

from collections.abc import Mapping
from os import PathLike
from typing import Any

from ._async_client import AsyncClient, AsyncRegistration
from ._client import Client, Registration
from ._errors import NoConnection, NotRegistered, Refused, VisageError
from ._progress import Progress
from ._surfaces import Mesh, PointCloud
from ._uploads import Paths, Poses

__all__ = [
    "AsyncClient",
    "AsyncRegistration",
    "Client",
    "Mesh",
    "NoConnection",
    "NotRegistered",
    "PointCloud",
    "Progress",
    "Refused",
    "Registration",
    "VisageError",
    "register",
]


def register(
    scans: Paths,
    *,
    url: str | None = None,
    key: str | None = None,
    poses: Poses | None = None,
    unit: str | None = None,
    name: str | None = None,
    label: str | None = None,
    options: Mapping[str, Any] | None = None,
    hints: str | PathLike[str] | Mapping[str, Any] | None = None,
    progress: Progress | None = None,
) -> Registration:
    """Sends scans to a service, waits until they are registered, and gives the result.

    `url` and `key` are those of VISAGE_SERVER and VISAGE_KEY where they are not given; see `Client.register` for the rest.
    """
    client = Client(url, key=key)
    return client.register(
        scans, poses=poses, unit=unit, name=name, label=label, options=options, hints=hints, progress=progress
    )
