"""The networks that are exported, and their inverse: gates and affine experts, fitted to finished charts in closed form."""
