"""FlexPara as the paper describes it (Zhao et al. 2025, arXiv 2504.19210): preset ``paper``.

Public face: `pipeline.train_paper_surface` and `config.PaperConfig`.
"""
