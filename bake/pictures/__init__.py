"""Pictures for people: the preview of an unwrap, drawn on a small off-screen canvas.

Public face: `preview.render_preview`; `canvas.draw` and `lettering.with_text` for pictures of one's own.
"""
