"""Trackers of OpenCV's video module behind the common interface.

They take integer boxes and cut their crops inside C++, so only whole frames can be enhanced.
"""
