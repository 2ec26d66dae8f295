//! Levenberg–Marquardt over plain vectors; knows nothing of garments.
