"""Mathematics of parametric body models beyond SMPL: STAR, SUPR, SKEL, MHR and Anny."""
