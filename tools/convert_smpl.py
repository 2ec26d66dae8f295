#!/usr/bin/env python3
"""Turns a body model of the SMPL family into a plain .npz that `dress` reads.

    python3 tools/convert_smpl.py basicModel_f.pkl smpl_female.npz [COMPONENTS]

Downloads of SMPL, SMPL+H and SMPL-X are Python pickles or .npz with pickled objects. Reading a pickle
runs code that its author wrote, so `dress` does not; run this once, yourself, on a file you trust.
Needs numpy, and scipy for pickles with sparse joint regressors. Chumpy is not needed: its arrays are
taken apart without it. STAR's pose directions belong to another pose feature and are left out.
"""
import pickle
import sys

import numpy as np

KEPT = ["v_template", "shapedirs", "posedirs", "J_regressor", "weights", "kintree_table", "f"]


class Unpickler(pickle.Unpickler):
    """Puts a plain holder in the place of every chumpy class."""

    class Holder:
        def __setstate__(self, state):
            self.__dict__.update(state)

    def find_class(self, module, name):
        return self.Holder if module.startswith("chumpy") else super().find_class(module, name)


def plain(value):
    """A dense array of what may be sparse, or chumpy's."""
    if hasattr(value, "toarray"):
        value = value.toarray()
    for field in ("x", "r"):
        if isinstance(value, Unpickler.Holder) and hasattr(value, field):
            value = getattr(value, field)
    return np.asarray(value)


def main(source, target, components=40):
    if source.endswith(".npz"):
        loaded = np.load(source, allow_pickle=True)
        model = {key: loaded[key][()] for key in loaded.files}
    else:
        with open(source, "rb") as file:
            model = Unpickler(file, encoding="latin1").load()
    arrays = {key: plain(model[key]) for key in KEPT if key in model}
    missing = [key for key in KEPT if key not in arrays and key != "posedirs"]
    if missing:
        sys.exit(f"{source} has no {', '.join(missing)}: it is no model of the SMPL family")
    arrays["shapedirs"] = arrays["shapedirs"][:, :, : int(components)]
    joints = arrays["kintree_table"].shape[1]
    if "posedirs" in arrays and arrays["posedirs"].shape[-1] != 9 * (joints - 1):
        print("left out: pose directions that are not SMPL's")
        del arrays["posedirs"]
    np.savez_compressed(target, **arrays)


if __name__ == "__main__":
    if len(sys.argv) not in (3, 4):
        sys.exit(__doc__)
    main(*sys.argv[1:])
