"""Requests to the simulator and their answers."""

from __future__ import annotations

import json
import urllib.error
import urllib.request
from http.client import HTTPException, HTTPResponse
from typing import Any

from .errors import RefusedError, UnreachableError

# The simulator runs on this computer or in its network, so a proxy for the web cannot be used.
_OPENER = urllib.request.build_opener(urllib.request.ProxyHandler({}))


class Http:
    """The HTTP interface of a simulator."""

    def __init__(self, url: str, timeout: float):
        self.url = url.rstrip("/")
        self.timeout = timeout

    def open(self, method: str, path: str, body: Any = None) -> HTTPResponse:
        """Sends a request and returns the answer, which is not yet read.

        RefusedError when the simulator refuses it, UnreachableError when there is no answer."""
        data = None if body is None else json.dumps(body).encode()
        request = urllib.request.Request(self.url + path, data=data, method=method)
        if data is not None:
            request.add_header("Content-Type", "application/json")
        try:
            answer: HTTPResponse = _OPENER.open(request, timeout=self.timeout)
            return answer
        except urllib.error.HTTPError as refusal:
            with refusal:
                raise RefusedError(refusal.code, _message(refusal)) from None
        except (OSError, HTTPException) as error:
            raise self.unreachable(error) from error

    def ask(self, method: str, path: str, body: Any = None) -> Any:
        """Sends a request and returns the JSON of the answer."""
        with self.open(method, path, body) as answer:
            try:
                return json.load(answer)
            except (OSError, HTTPException) as error:
                raise self.unreachable(error) from error
            except ValueError:
                raise UnreachableError(f"what answers at {self.url} is no simulator") from None

    def unreachable(self, error: Exception) -> UnreachableError:
        """Returns the error that reports an unreachable simulator, with the reason."""
        return UnreachableError(f"no answer from {self.url}: {getattr(error, 'reason', error) or 'it has ended'}")


def _message(refusal: urllib.error.HTTPError) -> str:
    """Returns the server's message for a refusal."""
    try:
        return str(json.load(refusal)["error"])
    except (OSError, HTTPException, ValueError, KeyError, TypeError):
        return f"HTTP status {refusal.code}"
