"""Small texts to be mutated: scans of every kind of text, poses and intrinsics of every format."""

import json

import numpy as np

from scanweld.geometry.camera import Camera, CameraModel
from scanweld.geometry.pose import Pose
from scanweld.io.pose_formats import FORMATS, PosedScan

_AXES = [f"{axis}_axis{part}" for axis in "xyz" for part in "xyz"]
_CAMERA = "".join(f"property float {name}\n" for name in ("view_px", "view_py", "view_pz", *_AXES))
_VERTEX = "element vertex 4\nproperty float x\nproperty float y\nproperty float z\n"

SCANS = {
    "plain.xyz": "0 0 1 0 1 0\n1 0 2 1 0 0\n0 1 3 0 0 1\n1 1 1 0 0 1\n",
    "count.pts": "4\n0.5 2 3 -9 255 0 0\n1 0 2.5 8 0 255 0\n0 1 3 7 0 0 255\n1 1 1 6 9 9 9\n",
    "comma.asc": "0,25\t0\t1,5\n1\t0,125\t2\n0\t1\t3,75\n1,5\t1\t1\n",
    "names.csv": 'a scan\n"Point";"X [m]";"Y";"Z";"R";"G";"B";"Nx";"Ny";"Nz"\n'
    "1;0;0;1,5;255;0;0;0;0;1\n2;1;0;2;0;255;0;0;1;0\n3;0,5;1;3;0;0;255;1;0;0\n",
    "words.csv": 'time,x,y,z,name\n07:01,0,0,1,"a, b"\n07:02,1,0,2,\n07:03,0,1,NA,c\n',
    "a.obj": "# o\nv 0 0 0 1 0 0\nv 1 0 0 0 1 0\nv 0 1 0 0 0 1\nvn 0 0 1\nf 1//1 2/3 -1\n",
    "a.off": "COFF\n3 1 0\n0 0 0 9 9 9 255\n1 0 0 9 9 9 255\n0 1 0 9 9 9 255\n3 0 1 2\n",
    "a.stl": "solid a\nfacet normal 0 0 1\nouter loop\nvertex 0 0 0\nvertex 1 0 0\n"
    "vertex 0 1 0\nendloop\nendfacet\nendsolid a\n",
    "mesh.ply": "ply\nformat ascii 1.0\nobj_info num_cols 2\nobj_info num_rows 2\n"
    f"{_VERTEX}property uchar intensity\nelement range_grid 4\n"
    "property list uchar int vertex_indices\nend_header\n"
    "0 0 0 1\n1 0 0 2\n1 1 0 3\n0 1 0 4\n1 0\n1 1\n0\n1 2\n",
    "camera.ply": f"ply\nformat ascii 1.0\n{_VERTEX}element camera 1\n{_CAMERA}end_header\n"
    "0 0 5\n1 0 5\n0 1 5\n1 1 6\n0.5 0.5 0 1 0 0 0 1 0 0 0 1\n",
}
"""Scans by the names of their files."""

_MATRIX = [[0, -1, 0, 1], [1, 0, 0, 2], [0, 0, 1, 3], [0, 0, 0, 1]]
_POSES = {"one": np.eye(4).tolist(), "two": _MATRIX}


def poses() -> dict[str, str]:
    """Files with the poses of two scans, in every format, by their names."""
    camera = Camera(model=CameraModel.PINHOLE, width=40, height=30, fx=50, fy=60, cx=20, cy=15)
    scans = [
        PosedScan(
            name=name,
            world_from_scan=Pose.from_matrix(np.array(matrix)),
            file=f"{name}.ply",
            camera=camera,
            scan_from_sensor=Pose.identity(),
            shift=np.array([4e6, 5e5, 0]),
        )
        for name, matrix in _POSES.items()
    ]
    texts = [next(iter(form.write(scans).items())) for form in FORMATS.values()]
    own = {"format": 1, "scans": _POSES, "components": [["one", "two"]], "unplaced": {"b": "so"}}
    return {**dict(texts), "poses.json": json.dumps(own), "flat.json": json.dumps(_POSES)}


INTRINSICS = {
    "open3d.json": '{"width": 80, "height": 60, "intrinsic_matrix": [90, 0, 0, 0, 91, 0, 39, 28, '
    "1]}",
    "plain.json": '{"fx": 90, "fy": 91, "cx": 39, "cy": 28, "coeffs": [0.1, 0, 0, 0, 0], '
    '"depth_scale": 1000}',
    "numbers.txt": "90 91 39 28 80 60\n",
    "cameras.txt": "# cameras\n1 OPENCV 80 60 90 91 39 28 0.1 0 0 0\n",
    "ros.yaml": "image_width: 80\nimage_height: 60\ncamera_matrix:\n  rows: 3\n  cols: 3\n"
    "  data: [90, 0, 39, 0, 91, 28, 0, 0, 1]\ndistortion_model: plumb_bob\n"
    "distortion_coefficients:\n  rows: 1\n  cols: 5\n  data: [0.1, 0, 0, 0, 0]\n",
}
"""Intrinsics by the names of their files."""
