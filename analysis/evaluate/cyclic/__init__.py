"""Tests that load and unload again and again: their cycles, and the loop of stress and strain in each."""
