"""How results are shown in a notebook: HTML with tables and equations, figures as SVG.

Results declare no more than a line of text (:mod:`pendulum_env.common.results`); here they get their HTML, an entry of
:data:`pendulum_env.notebook.cards.CARDS`, and their figures, an entry of :data:`pendulum_env.notebook.figures.FIGURES`.
"""

from pendulum_env.notebook.cards import html_of
from pendulum_env.notebook.figures import figure_of, figures

__all__ = ["figure_of", "figures", "html_of"]
