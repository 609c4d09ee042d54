"""The networks that are exported: charts divided into patches, networks fitted to them, and their inverse."""
