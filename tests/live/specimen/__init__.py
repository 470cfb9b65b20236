"""Tests of live.setup."""
