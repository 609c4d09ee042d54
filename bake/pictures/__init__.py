"""Pictures for people: the preview of an unwrap, drawn on a small off-screen canvas.

Public face: `preview.render_preview`; `canvas.draw` for pictures of one's own.
"""
