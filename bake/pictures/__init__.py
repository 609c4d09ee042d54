"""Pictures for people: the preview, contact sheets."""
