"""Bounds on what pages, and strangers, may send to the viewer's server, and on what waits for slow pages."""

from __future__ import annotations

from dataclasses import dataclass


@dataclass(frozen=True)
class Bounds:
    """Largest sizes and numbers; a connection or request beyond them is refused, and messages are dropped."""

    # Connections.
    connections: int = 150
    """Connections at a time, those of pages included."""
    pages: int = 100
    """Pages at a time: the samples of some minutes may wait for each."""
    message_bytes: int = 1_000_000
    """Size of a message from a page."""
    body_bytes: int = 1_000
    """Size of the body of an HTTP request: requests of our pages have none."""
    buffer_bytes: int = 2 * message_bytes
    """Bytes that are read ahead of a connection."""

    # Requests.
    requests: int = 64
    """Requests of one page that wait for an answer, or whose answer the page has not taken yet."""
    name_characters: int = 40
    """Characters of the name of a request."""
    nesting: int = 6
    """Levels of lists and objects in a request."""

    # Messages to slow pages.
    panel_messages: int = 16
    """Panel messages under way: an edit of the table changes the state of most panels."""
    sample_numbers: int = 100_000
    """Floats in samples that wait for a slow page, and that a new page gets: half an hour of a robot's errors are
    60 kB."""


BOUNDS = Bounds()
