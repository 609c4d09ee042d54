"""The networks that are exported, and their inverse: gates and affine experts, fitted to charts in closed form.

Public face: `fit.fit_networks` and `fit_wrap.fit_wrap`; `gated.GatedExperts` is what they give.
"""
