"""The networks that are exported, and their inverse: gates and affine experts, fitted to charts in closed form."""
