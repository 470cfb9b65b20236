"""Basler cameras through the maker's pypylon (extra ``pylon``); ``genicam:`` opens the same cameras without it."""
