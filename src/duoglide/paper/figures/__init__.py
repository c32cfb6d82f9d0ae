"""The figures of [Shen2021]_, computed: static for print, and one page to turn the 3D ones."""

from duoglide.paper.figures.write import write_figures

__all__ = ["write_figures"]
