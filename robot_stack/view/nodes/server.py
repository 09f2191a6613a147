"""Foxglove's websocket server: its channels and the subscriptions of its viewers."""

from __future__ import annotations

import queue
from typing import Any, NamedTuple

import foxglove
from foxglove.websocket import ChannelView, Client, ServerListener

from robot_stack.contract.model import Topic
from robot_stack.core.message_definitions import message_definition
from robot_stack.view.params import ViewParams


class ViewError(Exception):
    """The server cannot start. The message gives the reason."""


class Event(NamedTuple):
    """A viewer subscribes to or unsubscribes from a channel."""

    client: int
    channel: str
    looks: bool


class Listener(ServerListener):
    """Called in threads of the server."""

    def __init__(self, events: queue.SimpleQueue[Event]) -> None:
        self._events = events

    def on_subscribe(self, client: Client, channel: ChannelView) -> None:
        self._events.put(Event(client.id, channel.topic, looks=True))

    def on_unsubscribe(self, client: Client, channel: ChannelView) -> None:
        """Also called when the client disconnects."""
        self._events.put(Event(client.id, channel.topic, looks=False))


def channel_of(row: Topic, context: foxglove.Context) -> foxglove.Channel:
    """The channel of a topic with its serialised messages."""
    text = message_definition(row.type).encode()
    schema = foxglove.Schema(name=row.type, encoding="ros2msg", data=text)
    return foxglove.Channel(row.name, schema=schema, message_encoding="cdr", context=context)


def start_server(params: ViewParams, listener: ServerListener, context: foxglove.Context) -> Any:
    """Raises ViewError if the port is not available."""
    try:
        return foxglove.start_server(
            name="robot_stack",
            host=params.host,
            port=params.port,
            server_listener=listener,
            context=context,
            message_backlog_size=params.backlog_messages,
        )
    except RuntimeError as error:
        raise ViewError(
            f"port {params.port} of {params.host} is not available: {error}; set another by `robot-stack view --port`"
        ) from error
