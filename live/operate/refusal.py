"""Why an order is not carried out."""

from __future__ import annotations


class OrderRefused(Exception):
    """Says in a sentence why an order is not carried out, and what to do."""
