"""Figures with a time: the rule for their age, the figures of a moment, and the watch over missing forces."""
