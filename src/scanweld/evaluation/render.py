"""Shaded pictures of meshes, for looking at results and for the documentation."""

from pathlib import Path

import numpy as np
from imageio.v3 import imwrite

from scanweld.geometry.arrays import ByteArray, FloatArray
from scanweld.geometry.camera import Camera, CameraModel
from scanweld.geometry.mesh import TriangleMesh, face_normals, vertex_normals
from scanweld.geometry.rasterize import render_depth
