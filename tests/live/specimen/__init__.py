"""Tests of live.specimen."""
