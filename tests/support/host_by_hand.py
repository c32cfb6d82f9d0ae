"""What a streamer sees of its host, for tests that have both in one thread."""

from __future__ import annotations

from duoglide.control.channel.events import Condition, Happening
from duoglide.control.channel.orders import Command, Order
from duoglide.control.channel.ring import EventEntry
from duoglide.control.channel.setpoints import PreparedSetpoints


class HostByHand:
    """Gives orders and hands setpoints over; keeps what it is told.

    Attributes:
        events: Everything that was told.
        handed_over: Prepared setpoints by their number.
    """

    echoes = False

    def __init__(self) -> None:
        self.host_gone, self.host_waited = False, 0
        self.events: list[EventEntry] = []
        self.handed_over: dict[int, PreparedSetpoints] = {}
        self._orders: list[Order] = []

    # what tests do

    def order(self, command: Command, argument: int = 0, value: float = 0.0) -> None:
        self._orders.append(Order(command, argument, value))

    def happened(self, kind: Happening) -> list[EventEntry]:
        return [event for event in self.events if event.kind == kind]

    def tripped(self) -> list[tuple[Condition, int]]:
        conditions = list(Condition)
        trips = self.happened(Happening.TRIP)
        return [(conditions[trip.detail], trip.axis) for trip in trips]

    # what the streamer sees

    def orders(self) -> list[Order]:
        orders, self._orders = self._orders, []
        return orders

    def prepared(self, number: int) -> PreparedSetpoints | None:
        return self.handed_over.get(number)

    def following(self, number: int) -> PreparedSetpoints | None:
        others = self.handed_over.values()
        return next((other for other in others if other.after == number and number), None)

    def put_event(self, entry: EventEntry) -> None:
        self.events.append(entry)

    def end_deaf_host(self) -> None:
        pass

    def close(self) -> None:
        pass
