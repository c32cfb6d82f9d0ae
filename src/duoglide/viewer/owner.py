"""One page gives the orders, others watch.

Whoever comes first is the owner; when the owner goes, the next one is. A watcher may hold the
machine, stop it, look around, and take over.
"""

from __future__ import annotations

import time
from collections.abc import Callable
from typing import Any

_TOLD = 1.0  # [s] between two times that a page is told why
_FREE = ("ViewerCameraMessage", "GetRenderResponseMessage")
_NEVER = ("ShareUrlRequest", "ShareUrlDisconnect")  # nothing of here goes to a public tunnel


class Owner:
    """Judges each message of each page before viser hands it on.

    Args:
        refuse: Tells a page, by its number, why an order of it was not taken.
        clock: Monotonic time [s].
    """

    def __init__(
        self, refuse: Callable[[int, str], None], clock: Callable[[], float] = time.monotonic
    ) -> None:
        self._refuse, self._clock = refuse, clock
        self._pages: list[int] = []  # the owner first
        self._for_all: set[str] = set()
        self._told: dict[int, float] = {}

    @property
    def page(self) -> int | None:
        """Number of the page that gives the orders; None: nobody is there."""
        return self._pages[0] if self._pages else None

    @property
    def is_alone(self) -> bool:
        """Whether there is nobody who watches."""
        return len(self._pages) < 2

    def allow_all(self, *handles: Any) -> None:
        """Let watchers too use some elements of the page."""
        self._for_all |= {handle._impl.uuid for handle in handles}

    def come(self, page: int) -> None:
        """Note that a page has been opened."""
        self._pages.append(page)

    def go(self, page: int) -> None:
        """Note that a page has been closed."""
        self._told.pop(page, None)
        if page in self._pages:
            self._pages.remove(page)

    def take_over(self, page: int) -> None:
        """Make a page that is open the owner."""
        if page in self._pages:
            self._pages.remove(page)
            self._pages.insert(0, page)

    def admits(self, page: int, message: Any) -> bool:
        """Tell whether a message is to be listened to."""
        kind = type(message).__name__
        if kind in _NEVER:
            return False
        if kind in _FREE:
            return True
        if page == self.page or getattr(message, "uuid", None) in self._for_all:
            return True
        self._tell(page, "Another page gives the orders. Stop and Hold work; or Take over.")
        return False

    def _tell(self, page: int, reason: str) -> None:
        """Tell a page why it was not listened to, unless it was told just now."""
        now = self._clock()
        if now >= self._told.get(page, now - _TOLD) + _TOLD:
            self._told[page] = now
            self._refuse(page, reason)

    def guard(self, server: Any) -> None:
        """Stand before the handlers of a viser server."""
        inner = server._websock_server
        handle = inner._handle_incoming_message

        async def guarded(page: int, message: Any) -> None:
            if not self.admits(page, message):
                return
            try:
                await handle(page, message)
            except Exception as error:  # what viser makes of a value that is none, NaN perhaps
                self._tell(page, f"That is not understood: {error}")

        inner._handle_incoming_message = guarded
        server.on_client_connect(lambda client: self.come(client.client_id))
        server.on_client_disconnect(lambda client: self.go(client.client_id))
