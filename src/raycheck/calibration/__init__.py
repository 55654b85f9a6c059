"""Measuring raycheck itself: false alarms, kill rate, detectable bias, naming."""
