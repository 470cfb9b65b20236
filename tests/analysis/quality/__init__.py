"""Tests of analysis.quality."""
