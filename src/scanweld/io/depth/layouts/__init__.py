"""Layouts of captures: how programs and data sets lay depth images, cameras and poses into folders.

One module a layout, with a ``LAYOUT``; ``registry`` finds them.
"""
