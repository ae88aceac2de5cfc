"""Which service is meant, and as whom."""

import os
import httpx

from ._drive import Core
from .core import AuthenticatedClient
from .core import Client as Anonymous

HERE = "http://127.0.0.1:8080"
ANSWER_SECONDS = 120.0
"""How long an answer is waited for: longer than the service holds one back."""


def core(url: str | None, key: str | None, verify: str | bool) -> Core:
    """The generated client of a service."""
    base = (url or os.environ.get("VISAGE_SERVER") or HERE).rstrip("/")
    key = key or os.environ.get("VISAGE_KEY")
    timeout = httpx.Timeout(ANSWER_SECONDS, connect=10.0)
    if key is None:
        return Anonymous(base_url=base, timeout=timeout, verify_ssl=verify)
    return AuthenticatedClient(base_url=base, token=key, timeout=timeout, verify_ssl=verify)
