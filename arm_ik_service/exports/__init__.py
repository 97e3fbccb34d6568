"""The published state in other people's formats: a file a dialect, and `axes.py`, which knows every axis convention."""
