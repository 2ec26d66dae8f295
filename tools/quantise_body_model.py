#!/usr/bin/env python3
"""Makes data/body-model/default.npz, the body model that comes with the project, from mhbody_lite.npz.

    python3 tools/quantise_body_model.py mhbody_lite.npz data/body-model/default.npz

mhbody_lite.npz is made from MakeHuman's CC0 data by tools/body_model/make_bodies.py (see there). This
script keeps what the fit uses: the first 40 of 60 shape components, and all directions as 16-bit
integers, with one scale per component (`shapedirs_scale`, `propdirs_scale`: value = integer * scale).
Triangles of the right side become the mirror images of the left side's: a few are cut along the other
diagonal of the same four corners, and a body as symmetric as its vertices has to have both alike.
Needs numpy only. Members carry no time, so the same input gives the same bytes.
"""
import io
import sys
import zipfile

import numpy as np

COMPONENTS = 40
KEPT = ["v_template", "J_regressor", "weights", "kintree_table", "f", "mirror", "license"]


def quantised(directions):
    """(V, 3, K) reals as 16-bit integers and the (K,) scales that give them back."""
    scale = np.abs(directions).max(axis=(0, 1)).astype(np.float32) / 32767
    return np.rint(directions / scale).astype(np.int16), scale


def symmetric(faces, mirror, template):
    """The faces, where those of the right side (x < 0) that are no mirror images are put right."""
    images = mirror[faces][:, ::-1]
    known = {frozenset(face) for face in faces.tolist()}
    odd = np.array([frozenset(face) not in known for face in images.tolist()])
    left = template[faces].mean(axis=1)[:, 0] > 0
    faces = faces.copy()
    faces[odd & ~left] = images[odd & left]
    return faces


def main(source, target):
    model = np.load(source)
    arrays = {name: model[name] for name in KEPT}
    arrays["f"] = symmetric(model["f"], model["mirror"], model["v_template"])
    arrays["shapedirs"], arrays["shapedirs_scale"] = quantised(model["shapedirs"][:, :, :COMPONENTS])
    arrays["propdirs"], arrays["propdirs_scale"] = quantised(model["propdirs"])
    arrays["prop_names"] = model["prop_names"]
    with zipfile.ZipFile(target, "w", zipfile.ZIP_DEFLATED, compresslevel=9) as archive:
        for name, array in arrays.items():
            member = io.BytesIO()
            # Component by component, neighbouring vertices beside each other: deflates best.
            np.lib.format.write_array(member, np.asfortranarray(array), allow_pickle=False)
            entry = zipfile.ZipInfo(name + ".npy", date_time=(1980, 1, 1, 0, 0, 0))
            entry.compress_type = zipfile.ZIP_DEFLATED
            archive.writestr(entry, member.getvalue())


if __name__ == "__main__":
    if len(sys.argv) != 3:
        sys.exit(__doc__)
    main(*sys.argv[1:])
